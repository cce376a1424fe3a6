"""Fails on any #include in lib/ that its module's arrows do not allow.

    check_includes.py LIB_FOLDER LAYERS_FILE

LAYERS_FILE has a line "module: direct dependencies" per module (written when the build is configured). A module may include
itself and what its arrows lead to, however far. Only messaging knows LCM and the message types generated from lcmtypes/.
"""
import pathlib
import re
import sys

INCLUDE = re.compile(r'^\s*#\s*include\s*(?P<open>["<])(?P<path>[^">]+)[">]')
SOURCES = {".h", ".hpp", ".cpp", ".cc", ".inl"}
LCM_FOLDERS = {"lcm", "vantage"}  # LCM's own headers; the generated types live in package vantage.


def read_layers(text):
    layers = {}
    for line in text.splitlines():
        if line.strip():
            module, _, depends = line.partition(":")
            layers[module.strip()] = depends.split()
    return layers


def reachable(layers, module):
    """The module and everything its arrows lead to."""
    found, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += layers.get(name, [])
    return found


def problems(lib, layers):
    folders = sorted(path for path in lib.iterdir() if path.is_dir())
    modules = {folder.name for folder in folders} | set(layers)
    for folder in folders:
        files = sorted(path for path in folder.rglob("*") if path.suffix in SOURCES)
        if folder.name not in layers:
            # Headers alone are an interface that is still to be implemented; its arrows are not written down yet.
            if any(path.suffix != ".h" for path in files):
                yield f"{folder}: module '{folder.name}' has sources but no arrows; list it in lib/CMakeLists.txt"
            continue
        allowed = reachable(layers, folder.name)
        for path in files:
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                match = INCLUDE.match(line)
                if not match or "/" not in match["path"]:
                    continue
                included = match["path"].split("/")[0]
                where = f"{path}:{number}"
                if included in LCM_FOLDERS and folder.name != "messaging":
                    yield f"{where}: only messaging may include LCM, found {match['path']}"
                elif included in modules and match["open"] == '"' and included not in allowed:
                    yield (f"{where}: {folder.name} may not include {match['path']}; its arrows lead to: "
                           f"{' '.join(sorted(allowed - {folder.name})) or 'nothing'}")


def main(arguments):
    if len(arguments) != 2:
        print(__doc__, file=sys.stderr)
        return 1
    lib, layers_file = map(pathlib.Path, arguments)
    layers = read_layers(layers_file.read_text(encoding="utf-8"))
    if not layers:
        print(f"{layers_file}: no modules; configure the build again", file=sys.stderr)
        return 1
    found = list(problems(lib, layers))
    for problem in found:
        print(problem, file=sys.stderr)
    print(f"{len(layers)} modules, {len(found)} includes that no arrow allows")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
