"""Fails where a parameter struct of the library has a field that its YAML does not know.

    check_fields.py SOURCE_FOLDER

A struct counts where processes/common/params.cpp has a function Fields(Visitor&, module::STRUCT&).
"""
import pathlib
import re
import sys

NOT_YAML = {("LearnerParams", "recogniser")}  # A section of its own.


def struct_fields(header, name):
    start = header.find(f"struct {name} {{")
    if start < 0:
        return None
    body = re.sub(r"//.*", "", header[start:header.index("\n};", start)])
    statements = [re.sub(r"\{.*", "", re.sub(r"=.*", "", text, flags=re.S), flags=re.S) for text in body.split("{", 1)[1].split(";")]
    return {text.split()[-1] for text in statements if len(text.split()) >= 2 and "(" not in text}


def main(source):
    reader = (source / "processes/common/params.cpp").read_text(encoding="utf-8")
    failed = False
    for module, name, body in re.findall(r"void Fields\(Visitor& visit, (\w+)::(\w+)& params\) \{(.*?)\n\}", reader, re.S):
        known = set(re.findall(r'"(\w+)"', body))
        headers = [path.read_text(encoding="utf-8") for path in sorted((source / "lib" / module).glob("*.h"))]
        fields = next(filter(None, (struct_fields(header, name) for header in headers)), None)
        if not fields:
            print(f"{module}::{name}: no such struct in lib/{module}", file=sys.stderr)
            failed = True
            continue
        for field in sorted(fields - known):
            if (name, field) not in NOT_YAML:
                print(f"{module}::{name}.{field} is not read from YAML; add it to params.cpp and config/library.yaml", file=sys.stderr)
                failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
