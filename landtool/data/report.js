"use strict";
(() => {
  const byId = (id) => document.getElementById(id);

  // A video in the page becomes a Blob: a data: URL cannot be sought in.
  function load(video, key) {
    const data = byId("data-" + key);
    if (!video || !data) return;
    const text = atob(data.textContent.trim());
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    video.src = URL.createObjectURL(new Blob([bytes], { type: "video/mp4" }));
    data.remove();
  }

  // The last place of an ascending list whose value is not above `value`
  function lastAt(list, value) {
    let low = 0, high = list.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (list[middle] <= value) low = middle; else high = middle - 1;
    }
    return low;
  }

  function player(slider) {
    const key = slider.dataset.player, video = byId("video-" + key);
    const line = JSON.parse(byId("line-" + key).textContent);
    const start = line.at[0], end = line.end, last = line.at.length - 1;
    const plots = [...document.querySelectorAll('.plot[data-player="' + key + '"]')];
    const hand = slider.querySelector(".hand"), now = byId("now-" + key);
    let current = 0;
    load(video, key);

    const number = (i) => Array.isArray(line.frame) ? line.frame[i] : line.frame + i;
    function told(i) {
      const facts = line.rows.map(([name, changes]) => {
        const value = changes[lastAt(changes.map((change) => change[0]), i)][1];
        return value ? name + " " + value : "";
      });
      const when = line.unit === "s" ? line.at[i].toFixed(2) + " s, " : "";
      return when + ["frame " + number(i), ...facts].filter(Boolean).join(", ");
    }
    function show(i) {
      current = i;
      const at = line.at[i], text = told(i);
      hand.style.left = 100 * (at - start) / (end - start) + "%";
      slider.setAttribute("aria-valuenow", at);
      slider.setAttribute("aria-valuetext", text);
      now.textContent = text;
      for (const plot of plots) {
        const cursor = plot.querySelector(".cursor"), low = +plot.dataset.start, high = +plot.dataset.end;
        if (!cursor) continue;
        const width = plot.dataset.right - plot.dataset.left;
        const x = Math.min(Math.max((at - low) / (high - low), 0), 1) * width;
        cursor.setAttribute("transform", "translate(" + x.toFixed(1) + " 0)");
        cursor.setAttribute("visibility", "visible");
      }
    }
    // One after the other, the last one wins: browsers choke on a seek inside a seek
    let wanted = null, target = null;
    function go(seconds) {
      if (video.seeking) wanted = seconds; else video.currentTime = seconds;
    }
    // Half a millisecond into the picture, or rounding would show the one before
    function seek(i) {
      show(i);
      if (!video || !line.shown) return;
      target = line.shown[i] + 0.0005;
      go(target);
    }
    const seekTo = (at) => seek(lastAt(line.at, at));

    function place(event, box) {
      return Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    }
    let held = false;
    slider.addEventListener("pointerdown", (event) => {
      held = true;
      slider.setPointerCapture(event.pointerId);
      seekTo(start + place(event, slider.querySelector(".track").getBoundingClientRect()) * (end - start));
    });
    slider.addEventListener("pointermove", (event) => {
      if (held) seekTo(start + place(event, slider.querySelector(".track").getBoundingClientRect()) * (end - start));
    });
    for (const name of ["pointerup", "pointercancel"]) slider.addEventListener(name, () => { held = false; });

    function bySeconds(seconds) {
      if (line.unit !== "s") return seek(Math.min(Math.max(current + 10 * seconds, 0), last));
      const at = lastAt(line.at, line.at[current] + seconds + 1e-6);
      return seek(Math.min(Math.max(at, 0), last));
    }
    function toggle() {
      seek(current);
      if (!video) return;
      if (video.paused) video.play(); else video.pause();
    }
    const keys = {
      ArrowRight: () => seek(Math.min(current + 1, last)), ArrowLeft: () => seek(Math.max(current - 1, 0)),
      ArrowUp: () => bySeconds(1), ArrowDown: () => bySeconds(-1),
      PageUp: () => bySeconds(5), PageDown: () => bySeconds(-5),
      Home: () => seek(0), End: () => seek(last), Enter: toggle, " ": toggle,
    };
    slider.addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      act();
    });
    for (const plot of plots) {
      plot.addEventListener("click", (event) => {
        const svg = plot.querySelector("svg"), box = svg.getBoundingClientRect(), scale = box.width / svg.viewBox.baseVal.width;
        const inner = { left: box.left + plot.dataset.left * scale, width: (plot.dataset.right - plot.dataset.left) * scale };
        seekTo(+plot.dataset.start + place(event, inner) * (plot.dataset.end - plot.dataset.start));
      });
    }
    for (const button of document.querySelectorAll('button[data-player="' + key + '"]')) {
      button.addEventListener("click", () => {
        seekTo(+button.dataset.at + 1e-6);
        (video || slider).scrollIntoView({ block: "center" });
      });
    }
    if (video && line.shown) {
      const short = () => target !== null && video.paused && target > video.currentTime + 0.001;
      const follow = () => { if (!video.seeking && wanted === null) show(lastAt(line.shown, video.currentTime + 0.0005)); };
      const each = () => { follow(); if (!video.paused) requestAnimationFrame(each); };
      video.addEventListener("play", each);
      video.addEventListener("seeked", () => {
        const next = wanted;
        wanted = null;
        if (next !== null) { video.currentTime = next; return; }
        if (short()) return;
        target = null;
        follow();
      });
      // Of a video that starts late a browser first takes the end for too early, and seeks no further than that
      video.addEventListener("durationchange", () => { if (short()) go(target); });
      video.addEventListener("timeupdate", follow);
    }
    show(0);
  }
  document.querySelectorAll(".timeline").forEach(player);
})();
