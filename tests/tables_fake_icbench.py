#!/usr/bin/python3 -SE
"""A stand-in for icbench: answers at once with figures that follow from its arguments by formulas.

A picture is one value everywhere: 1 plus the error of its method. FAKE_FAIL: a command line that holds this
text fails. FAKE_KILL "N FILE": the Nth call (FILE counts them) kills its caller, with half of its files
written.
"""
import json
import os
import signal
import struct
import sys

SCENES = ["cornell_box", "bunnies_1", "office"]
# Seconds of indirect light for a frame: first, later ones.
SECONDS = {
    "whitted": (0.0, 0.0), "path": (9.0, 9.0), "instant_gi": (4.0, 4.0), "instant_gi_interleaved": (2.0, 2.0),
    "instant_caching": (0.8, 0.8), "temporal_instant_caching": (0.8, 0.1), "irradiance_cache": (0.5, 0.5),
    "hash_cells": (0.1, 0.1)
}
OVERHEAD = 0.5  # of a whole frame


def exr(value, width, height):
    def attribute(name, kind, data):
        return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data

    channels = b"".join(c + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = struct.pack("<II", 20000630, 2) + attribute(b"channels", b"chlist", channels) + \
        attribute(b"compression", b"compression", b"\0") + attribute(b"dataWindow", b"box2i", window) + b"\0"
    line = struct.pack(f"<{3 * width}f", *[value] * (3 * width))
    table = struct.pack(f"<{height}Q", *(len(head) + 8 * height + (8 + len(line)) * y for y in range(height)))
    return head + table + b"".join(struct.pack("<ii", y, len(line)) + line for y in range(height))


def value_of(path):
    """Of a picture, or of the pictures of a folder."""
    if os.path.isdir(path):
        return [value_of(os.path.join(path, name))[0] for name in sorted(os.listdir(path))]
    with open(path, "rb") as file:
        return [struct.unpack("<f", file.read()[-4:])[0]]


def write(path, data):
    with open(path, "wb" if isinstance(data, bytes) else "w") as file:
        file.write(data)


def error_of(o):
    """Of a method's picture: IGI's falls with the number of VPLs, a cache adds 0.02 times its accuracy."""
    if o["integrator"] == "path":
        return 0.001 * (1 if int(o["seed"]) % 2 else -1)
    noise = 0.05 if o["spp"] == "1" else 0.0  # of direct light
    if o["integrator"] == "whitted":
        return 0.5 + noise
    cached = 0.02 * float(o["accuracy"]) if "accuracy" in o else 0.0
    if o["integrator"] == "hash_cells":
        return noise + 0.16 / int(o["paths"])
    return noise + 0.32 / int(o.get("vpls", 64)) + cached


def cost(o, frame):
    first, later = SECONDS[o["integrator"]]
    scale = int(o.get("vpls", 64)) / 64 * int(o.get("paths", 1)) / float(o.get("accuracy", 1))
    threads = int(o.get("threads", 1))
    faster = {"global_mutex": threads**0.25}.get(o.get("cache"), threads)
    indirect = (later if frame else first) * scale / faster
    records = 1000 * (threads if o.get("cache") == "local_write" else 1)
    return {
        "seconds": OVERHEAD + indirect, "seconds_indirect": indirect, "rays": 1000, "shadow_rays": 500,
        "records": records, "records_kept": 900, "records_updated": 60, "records_dropped": 40,
        "light_paths": 64, "light_paths_retraced": 4,
        "bytes_beside_cache": records * (int(o.get("vpls", 64)) // 8 + 48 + 112), "bytes_of_details": records * 112,
        "lock_wait_share": 0.25 if o.get("cache") == "global_mutex" and threads > 1 else 0.0
    }


def options_of(arguments):
    return {key[2:]: value for key, value in zip(arguments[::2], arguments[1::2])}


def compare(arguments):
    a, b = value_of(arguments[0]), value_of(arguments[1])
    assert len(a) == len(b) > 0
    o = options_of(arguments[2:])
    rmse = (sum((x - y)**2 for x, y in zip(a, b)) / len(a))**0.5
    if "map" in o:
        os.mkdir(o["map"])
        write(os.path.join(o["map"], "hdrvdp.png"), b"a map")
    all_ = {
        "rmse": rmse, "relmse": rmse**2, "mean_ratio": 1 + b[0] - a[0], "flip": rmse / 2,
        "flicker": rmse / 10, "hdrvdp": {"p75": 100 * rmse, "p95": 50 * rmse}
    }
    names = o["metrics"].split(",") + (["flicker"] if os.path.isdir(arguments[0]) else [])
    return o["json"], {name: all_[name] for name in names}


def picture(command, arguments):
    o = options_of(arguments)
    width, height = map(int, o["size"].split("x"))
    data = exr(1 + error_of(o), width, height)
    if command == "render":
        write(o["out"], data)
        result = cost(o, 0)
    else:
        last = int(o["frames"]) - 1
        frames = [{"frame": f, **cost(o, f)} for f in [*range(0, last, int(o.get("every", 1))), last]]
        result = {**frames[-1], "frames": frames}
        if o["format"] == "exr":
            os.mkdir(o["out"])
            for f in frames:
                write(os.path.join(o["out"], f"frame_{f['frame']:04}.exr"), data)
    return o.get("json"), {"scene": o["scene"], **result}


def main():
    if sys.argv[1:] == ["--version"]:
        print("icbench 9.9, commit fake, no compiler, release build")
        return
    if sys.argv[1:] == ["list", "scenes", "--json"]:
        print(json.dumps([{"name": n, "analytic": False, "accuracy": 0.1, "description": f"a made-up {n}"} for n in SCENES]))
        return
    fail = os.environ.get("FAKE_FAIL")
    if fail and fail in " ".join(sys.argv):
        print("icbench: made to fail", file=sys.stderr)
        sys.exit(2)
    command, *arguments = sys.argv[1:]
    target, result = compare(arguments) if command == "compare" else picture(command, arguments)
    if target is None:
        return
    text = json.dumps(result)
    if "FAKE_KILL" in os.environ:
        count, file = os.environ["FAKE_KILL"].split(" ", 1)
        with open(file, "a") as log:
            log.write(".")
        if os.path.getsize(file) == int(count):
            write(target, text[:len(text) // 2])
            os.kill(os.getppid(), signal.SIGKILL)
            return
    write(target, text)


main()
