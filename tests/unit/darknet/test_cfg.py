from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest

from landtool.darknet.cfg import parse_cfg, read_cfg, write_cfg
from landtool.darknet.edit import edited
from landtool.darknet.network import Convolutional, MaxPool, Route, Yolo
from landtool.errors import InputError, OutputExistsError, UsageError
from tests.unit.darknet.networks import SMALL, layer, tiny_yolov3

OURS = Path(str(files("landtool"))) / "data" / "pad-tiny-yolov3.cfg"
ANCHORS = ((10, 14), (23, 27), (37, 58), (81, 82), (135, 169), (344, 319))


class TestRead:
    def test_tiny_yolov3_as_it_is_passed_round(self) -> None:
        network = parse_cfg(tiny_yolov3(80))
        assert (network.width, network.height, network.classes, network.stride) == (416, 416, 80, 32)
        assert len(network.layers) == 24
        assert network.parameters == 8_858_734  # (35,434,956 bytes - 20) / 4 of yolov3-tiny.weights
        assert [index for index, _ in network.heads] == [16, 23]
        assert [head.anchors for _, head in network.heads] == [ANCHORS[3:], ANCHORS[:3]]
        assert [head.out.stride for _, head in network.heads] == [32, 16]
        assert network.heads[0][1].ignore_iou == 0.7
        assert network.layers[17] == Route(network.layers[13].out, (13,), network.layers[17].line)
        assert network.layers[20].out.channels == 384
        assert network.training.batch == 1
        assert network.training.saturation == 1.5

    def test_our_own(self) -> None:
        network = read_cfg(OURS)
        assert network.classes == 1
        assert [head.anchors for _, head in network.heads] == [ANCHORS[3:], ANCHORS[:3]]
        last = network.layers[11]
        assert isinstance(last, MaxPool)
        assert (last.stride, last.padding) == (1, (0, 1))

    def test_the_masks_of_keras_yolo3(self) -> None:
        network = parse_cfg(tiny_yolov3(1).replace("mask = 0,1,2", "mask = 1,2,3"))
        assert network.heads[1][1].anchors == ANCHORS[1:4]

    def test_three_heads(self) -> None:
        third = "[route]\nlayers=0\n\n" + layer(filters=14, size=1) + SMALL[SMALL.rindex("[yolo]") :]
        assert [head.out.stride for _, head in parse_cfg(SMALL + "\n" + third).heads] == [8, 4, 2]

    def test_comments_behind_values_and_keys_of_training_only(self) -> None:
        text = tiny_yolov3(2, head="iou_thresh=0.213 # darknet\niou_loss=ciou", net="mosaic=1 ; more")
        text = text.replace("filters=21", "filters=21 # 3*(5+2)").replace("[upsample]", "[upsample] # 19")
        network = parse_cfg(text)
        assert network.classes == 2
        assert network.heads[0][1].positive_iou == 0.213

    def test_letter_box(self) -> None:
        assert not parse_cfg(SMALL).letterbox
        assert parse_cfg(SMALL.replace("channels=3", "channels=3\nletter_box=1")).letterbox


def bad(old: str, new: str, said: str) -> object:
    return pytest.param(lambda text: text.replace(old, new, 1), said, id=said)


class TestRefuse:
    @pytest.mark.parametrize(
        ("change", "said"),
        [
            bad("filters=4", "filters=2000000000", r"line 9: filters = 2000000000 is impossible; it must be 1 to 8192"),
            bad("filters=4", "filters=2e9", r"line 9: filters = 2e9 is impossible"),
            bad("filters=4", "filters=nan", r"line 9: filters = nan is not finite"),
            bad("filters=4", "filters=four", r"line 9: filters = four is no number"),
            bad("filters=4", "filters=4.5", r"line 9: filters = 4.5 is no whole number"),
            bad("layers=-3", "layers=7", r"line 46: layer 7 is not one before this; this is layer 7"),
            bad("layers=-3", "layers=-9", r"line 46: layer -9 is not one before this"),
            bad("layers=-3", "layers=6", r"line 46: layer 6 is a detection head"),
            bad("layers=-1,2", "layers=-1,0", r"line 52: joins layers of different size"),
            bad("layers=-3", "layers=", r"line 46: names no layer"),
            bad("layers=-3", "layers=-3\ngroups=2\ngroup_id=1", r"line 47: groups = 2 is not supported; only 1 is"),
            bad("[net]", "[data]", r"line 2: does not begin with \[net\]"),
            bad("[net]\n", "", r"line 2: is neither a \[section\] nor key=value"),
            bad("width=64", "width=64\nwidth=64", r"line 4: 'width' stands twice in \[net\]"),
            bad("width=64", "", r"line 2: \[net\] has no 'width'"),
            bad("width=64", "width=60", r"width = 60 is no multiple of 8"),
            bad("width=64", "width=640000", r"line 3: width = 640000 is impossible"),
            bad("channels=3", "channels=1", r"line 5: channels = 1 is not supported; only 3 is"),
            bad("[upsample]", "[shortcut]", r"line 48: \[shortcut\] is not supported; known are convolutional"),
            bad("activation=leaky", "activation=mish", r"line 13: activation 'mish' is not supported"),
            bad("activation=leaky", "activation=leaky\nxnor=1", r"line 14: \[convolutional\] key 'xnor' is not sup"),
            bad("size=3\nstride=2\npad=1", "size=3\nstride=2", r"line 7: the size of the picture would change"),
            bad("filters=14", "filters=12", r"line 34: 12 filters before \[yolo\] where 14 belong"),
            bad("filters=14\nsize=1\nactivation=linear", "filters=14\nactivation=leaky", r"must be linear"),
            bad("mask=2,3", "mask=2,4", r"line 40: mask must name anchors, counted from 0"),
            bad("mask=2,3", "mask=2,2", r"line 40: mask must name anchors"),
            bad("num=4", "num=5", r"line 43: num = 5, but there are 4 anchors"),
            bad("40,30", "40", r"line 41: anchors must be pairs"),
            bad("40,30", "40,0", r"line 41: anchors must be pairs"),
            bad("num=4", "num=4\nnew_coords=1", r"line 44: new_coords = 1 is not supported"),
            bad("classes=2", "classes=0", r"line 42: classes = 0 is impossible"),
            bad("[route]\nlayers=-3\n", "", r"line 39: a layer takes what a detection head gives out"),
            bad("[maxpool]", "nonsense", r"line 15: is neither a \[section\] nor key=value"),
        ],
    )
    def test_what_is_wrong_is_said_with_its_line(self, change: object, said: str) -> None:
        assert callable(change)
        with pytest.raises(InputError, match=said):
            parse_cfg(change(SMALL))

    def test_heads_of_different_classes(self) -> None:
        start, end = SMALL[: SMALL.rindex("[convolutional]")], SMALL[SMALL.rindex("[convolutional]") :]
        with pytest.raises(InputError, match="differ in their number of classes"):
            parse_cfg(start + end.replace("filters=14", "filters=12").replace("classes=2", "classes=1"))

    def test_no_head(self) -> None:
        with pytest.raises(InputError, match=r"has no \[yolo\] section"):
            parse_cfg(SMALL[: SMALL.index("[yolo]")])

    def test_a_network_beyond_all_memory(self) -> None:
        many = "".join(layer(filters=8192, size=11, pad=1) for _ in range(3)) + layer(filters=6, size=1)
        with pytest.raises(InputError, match="weights; that is no network of this kind"):
            parse_cfg(SMALL.replace("[maxpool]", many + "[maxpool]", 1).replace("layers=-1,2", "layers=-1,6"))

    @pytest.mark.parametrize(
        ("content", "said"),
        [
            (b"", r"x.cfg: line 1: does not begin with \[net\]"),
            (b"<!DOCTYPE html>\n<html lang=en>\n", r"x.cfg: line 1: is neither a \[section\] nor key=value"),
            (b'<html lang="en">\n', r"x.cfg: line 1: is neither"),
            (b"\x00\xff\xfe", "x.cfg: is no text"),
            (b"#" * (1 << 20) + b"#", "x.cfg: is far too long"),
        ],
    )
    def test_files_that_are_none(self, content: bytes, said: str, tmp_path: Path) -> None:
        (tmp_path / "x.cfg").write_bytes(content)
        with pytest.raises(InputError, match=said):
            read_cfg(tmp_path / "x.cfg")

    def test_a_file_that_is_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="does not exist"):
            read_cfg(tmp_path / "x.cfg")


class TestWrite:
    @pytest.mark.parametrize(
        "content",
        [
            SMALL.encode(),
            SMALL.replace("\n", "\r\n").encode(),
            b"\xef\xbb\xbf" + SMALL.encode(),
            ("# Größe\n" + SMALL.rstrip()).encode(),
        ],
        ids=["plain", "CRLF", "byte order mark", "no end of line"],
    )
    def test_gives_the_bytes_that_were_read(self, content: bytes, tmp_path: Path) -> None:
        (tmp_path / "a.cfg").write_bytes(content)
        network = read_cfg(tmp_path / "a.cfg")
        write_cfg(tmp_path / "b.cfg", network)
        assert (tmp_path / "b.cfg").read_bytes() == content
        assert read_cfg(tmp_path / "b.cfg") == network
        with pytest.raises(OutputExistsError):
            write_cfg(tmp_path / "b.cfg", network)


class TestEdit:
    def test_changes_what_is_asked_for_and_nothing_else(self) -> None:
        text = SMALL.replace("width=64", "width = 64  # across").replace("\n", "\r\n")
        changed = edited(parse_cfg(text), width=128, height=96)
        assert (changed.width, changed.height) == (128, 96)
        assert changed.text == text.replace("= 64  #", "= 128  #").replace("height=32", "height=96")
        assert edited(parse_cfg(text)).text == text

    def test_anchors_change_in_every_head(self) -> None:
        text = SMALL.replace("40,30\n", "40,30  # k-means\n")
        anchors = [(3.5, 4.25), (8, 9), (21, 22), (50, 60)]
        changed = edited(parse_cfg(text), anchors=anchors)
        assert [head.anchors for _, head in changed.heads] == [tuple(anchors[2:]), tuple(anchors[:2])]
        assert changed.text.count("anchors=3.5,4.25, 8,9, 21,22, 50,60  # k-means\n") == 2
        with pytest.raises(InputError, match="3 anchors where the cfg's masks choose from 4"):
            edited(changed, anchors=anchors[:3])

    @pytest.mark.parametrize("mark", ["", "\ufeff"])
    def test_a_key_that_is_not_there_is_put_in(self, mark: str) -> None:
        network = parse_cfg(mark + SMALL.replace("\n", "\r\n"))
        changed = edited(network, letterbox=True, anchors=[(1, 2), (3, 4), (5, 6), (7, 8)])
        assert changed.letterbox
        assert changed.text.startswith(f"{mark}# a small one\r\n[net]\r\nletter_box=1\r\nwidth=64\r\n")
        assert not edited(changed, letterbox=False).letterbox

    def test_refuses_what_would_be_no_network(self) -> None:
        with pytest.raises(InputError, match="width = 70 is no multiple of 8"):
            edited(parse_cfg(SMALL), width=70)

    def test_layers_keep_their_kind(self) -> None:
        network = parse_cfg(SMALL)
        changed = edited(network, width=128, letterbox=True)
        assert [type(one) for one in changed.layers] == [type(one) for one in network.layers]
        assert isinstance(changed.layers[0], Convolutional)
        assert isinstance(changed.layers[6], Yolo)
