"""What tests of machine code share: compiles a piece of C++ as the build compiles the caches, and takes it apart.

Environment: COMMANDS, the build's compile_commands.json; SOURCES, the folder src.
"""

import json
import os
import re
import shlex
import subprocess
from pathlib import Path

ROOT = Path(__file__).parent.parent
COMMANDS = Path(os.environ.get("COMMANDS", ROOT / "build/release/compile_commands.json"))
SOURCES = Path(os.environ.get("SOURCES", ROOT / "src"))


def flags():
    """Compiler and flags that the release build gives what runs the caches, without its precompiled headers and its
    output."""
    for entry in json.loads(COMMANDS.read_text()):
        if entry["file"].endswith("workload/dispatch.cpp"):
            words = shlex.split(entry["command"])
            break
    else:
        raise AssertionError(f"{COMMANDS} does not say how workload/dispatch.cpp is compiled")
    while os.path.basename(words[0]) in ("ccache", "sccache"):
        words.pop(0)
    kept, skip = [], False
    for word in words:
        if skip or word in ("-c", "-Winvalid-pch"):
            skip = False
        elif word in ("-o", "-include", "-MF", "-MT", "-I", "-Xclang"):
            skip = True
        elif not word.startswith(("-I", "-MD", "-M")) and not word.endswith((".cpp", ".cxx")) and "cmake_pch" not in word:
            kept.append(word)
    return kept


def functions(text, include, folder, name):
    """Instructions of each function that the compiler makes of `text` with the headers in `include`, by its symbol;
    addresses are replaced by where they are within it. Files named `name` are left in `folder`."""
    source = folder / f"{name}.cpp"
    source.write_text(text)
    made = folder / f"{name}.o"
    subprocess.run([*flags(), "-w", "-g0", "-I", include, "-c", source, "-o", made], check=True, timeout=300)
    said = subprocess.run(["objdump", "-dr", "--no-show-raw-insn", "--no-addresses", made], check=True, text=True,
                          capture_output=True).stdout
    found, current = {}, None
    for line in said.splitlines():
        start = re.match(r"<(.+)>:$", line.strip())
        if start:
            current = found.setdefault(start[1], [])
        elif current is not None and line.strip():
            current.append(re.sub(r"\s+", " ", re.sub(r"#.*", "", line)).strip())
    return found
