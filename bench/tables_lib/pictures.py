"""Pictures of the program: OpenEXR in and out, and small ones for looking at.

Only what icbench writes is read: one part of scan lines with channels R, G, B as half or float, not
compressed or by ZIP.
"""
from __future__ import annotations

import io
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

# Behind this folder: some names are in both.
sys.path.append(str(Path(__file__).resolve().parents[2] / "plots"))
from files import write_whole  # noqa: E402

kMagic = 20000630
kTypes = {1: np.dtype("<f2"), 2: np.dtype("<f4")}
kLinesPerBlock = {0: 1, 2: 1, 3: 16}  # compression: none, ZIPS, ZIP
kLuminance = np.array([0.2126, 0.7152, 0.0722])


class PictureError(Exception):
    """A file that is no picture of ours; one line."""


def frame_name(frame: int) -> str:
    return f"frame_{frame:04}.exr"


def frame_path(frame: int) -> str:
    """Of a frame in the folder of a job that made all of them."""
    return f"frames/{frame_name(frame)}"


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    """Attributes and where they end."""
    if struct.unpack_from("<I", data)[0] != kMagic or data[5] & 0x1A:
        raise PictureError("not a scan-line OpenEXR file of one part")
    attributes, at = {}, 8
    while data[at]:
        name_end = data.index(0, at)
        type_end = data.index(0, name_end + 1)
        size = struct.unpack_from("<i", data, type_end + 1)[0]
        start = type_end + 5
        if size < 0 or start + size > len(data):
            raise PictureError("the header is damaged")
        attributes[data[at:name_end].decode()] = data[start:start + size]
        at = start + size
    return attributes, at + 1


def _channels(table: bytes) -> list[tuple[str, np.dtype]]:
    made, at = [], 0
    while table[at]:
        end = table.index(0, at)
        made.append((table[at:end].decode(), kTypes[struct.unpack_from("<i", table, end + 1)[0]]))
        at = end + 17
    return made


def _unzip(packed: bytes, size: int) -> bytes:
    """A block: deflated differences of bytes, even ones first; or as it is where that was no shorter."""
    if len(packed) == size:
        return packed
    bytes_ = np.frombuffer(zlib.decompress(packed, bufsize=size), np.uint8)
    if bytes_.size != size:
        raise PictureError("a block has a wrong length")
    steps = bytes_.astype(np.int64)
    steps[1:] -= 128
    whole = np.cumsum(steps).astype(np.uint8)
    out = np.empty(size, np.uint8)
    half = (size + 1) // 2
    out[0::2], out[1::2] = whole[:half], whole[half:]
    return out.tobytes()


def read(path: Path) -> np.ndarray:
    """Height x width x 3, float32, linear. Raises PictureError or OSError."""
    data = Path(path).read_bytes()
    try:
        return _decode(data)
    except PictureError as error:
        raise PictureError(f"{path}: {error}") from None
    except (struct.error, zlib.error, KeyError, IndexError, ValueError) as error:
        raise PictureError(f"{path}: not a whole OpenEXR image ({error})") from None


def _decode(data: bytes) -> np.ndarray:
    attributes, at = _header(data)
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    channels = _channels(attributes["channels"])
    lines = kLinesPerBlock[attributes["compression"][0]]
    line_bytes = width * sum(kind.itemsize for _, kind in channels)
    out = np.zeros((height, width, 3), np.float32)
    for offset in struct.unpack_from(f"<{-(-height // lines)}Q", data, at):
        first, size = struct.unpack_from("<ii", data, offset)
        count = min(lines, bottom + 1 - first)
        packed = data[offset + 8:offset + 8 + size]
        block = np.frombuffer(
            packed if lines == 1 and size == line_bytes else _unzip(packed, count * line_bytes), np.uint8)
        block = block.reshape(count, line_bytes)
        start = 0
        for name, kind in channels:
            values = block[:, start:start + width * kind.itemsize].copy().view(kind)
            start += width * kind.itemsize
            if name in "RGB":
                out[first - top:first - top + count, :, "RGB".index(name)] = values
    return out


def encode(picture: np.ndarray) -> bytes:
    """The bytes of an OpenEXR file, floats, not compressed."""
    height, width, _ = picture.shape
    channels = b"".join(name + b"\0" + struct.pack("<iiii", 2, 0, 1, 1)
                        for name in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [("channels", "chlist", channels), ("compression", "compression", b"\0"),
                  ("dataWindow", "box2i", window), ("displayWindow", "box2i", window),
                  ("lineOrder", "lineOrder", b"\0"), ("pixelAspectRatio", "float", struct.pack("<f", 1)),
                  ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
                  ("screenWindowWidth", "float", struct.pack("<f", 1))]
    head = struct.pack("<II", kMagic, 2) + b"".join(
        name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
        for name, kind, value in attributes) + b"\0"
    planes = np.ascontiguousarray(picture[:, :, ::-1].transpose(0, 2, 1), "<f4")
    stride = 8 + width * 12
    table = struct.pack(f"<{height}Q", *(len(head) + 8 * height + stride * y for y in range(height)))
    return head + table + b"".join(
        struct.pack("<ii", y, width * 12) + planes[y].tobytes() for y in range(height))


def write_sum(weights: dict[str, float], target: str, folder: Path) -> dict:
    """The weighted sum of pictures of one size, by name, in `folder`."""
    total = sum(weight * read(folder / name).astype(np.float64) for name, weight in weights.items())
    (folder / target).write_bytes(encode(total.astype(np.float32)))
    return {}


def exposure_of(picture: np.ndarray) -> float:
    """The factor that makes the 98th percentile of luminance white: one for all pictures of a scene."""
    high = float(np.percentile(picture @ kLuminance, 98))
    return 1 / high if high > 0 else 1.0


def tone_mapped(picture: np.ndarray, exposure: float) -> Image.Image:
    """8 bits, sRGB."""
    linear = np.clip(picture * exposure, 0, 1)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear**(1 / 2.4) - 0.055)
    return Image.fromarray((curved * 255 + 0.5).astype(np.uint8), "RGB")


def write_image(image: Image.Image, path: Path, **options) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = io.BytesIO()
    image.save(made, path.suffix[1:].upper(), **options)
    write_whole(path, made.getvalue())


def write_preview(frames: dict[int, Path], exposure: float, side: int, path: Path) -> None:
    """An animated WebP of the pictures of frames by number, 25 frames a second, no side longer than `side`. A frame
    stands until the next that there is: animations of all frames and of some stay side by side.
    """
    small, numbers = [], [*frames]
    for picture in frames.values():
        image = tone_mapped(read(picture), exposure)
        image.thumbnail((side, side), Image.LANCZOS)
        small.append(image)
    shown = [40 * (after - number) for number, after in zip(numbers, [*numbers[1:], numbers[-1] + 1])]
    write_image(small[0], path, save_all=True, append_images=small[1:], duration=shown, loop=0, quality=80,
                method=4)
