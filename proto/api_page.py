#!/usr/bin/python3
"""Writes docs/api.md from the comments of the contract.

    proto/api_page.py            writes docs/api.md
    proto/api_page.py --check    fails where docs/api.md is not up to date

Reads what protoc understands (a descriptor set with source positions), so that
the page can say nothing that the contract does not.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

from google.protobuf import descriptor_pb2

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "api.md"
# In the order in which a reader wants them.
FILES = ("obstacle_service", "ingest_service", "mission_service", "types")

Field = descriptor_pb2.FieldDescriptorProto
# Numbers of the fields of descriptor.proto that lead to a comment.
MESSAGE, ENUM, SERVICE, FIELD, VALUE, METHOD = 4, 5, 6, 2, 2, 2
SYNTAX = 12


def read_contract(proto_root):
    """The contract's files with comments, in the order of FILES."""
    names = [f"fathom/v1/{name}.proto" for name in FILES]
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "contract.binpb"
        subprocess.run(
            ["protoc", f"-I{proto_root}", "-I/usr/include",
             "--include_source_info", f"--descriptor_set_out={out}", *names],
            check=True)
        found = descriptor_pb2.FileDescriptorSet.FromString(out.read_bytes())
    by_name = {file.name: file for file in found.file}
    return [by_name[name] for name in names]


class Comments:
    """Comments of one file by the path of what they stand at."""

    def __init__(self, file):
        self.leading = {}
        for place in file.source_code_info.location:
            path = tuple(place.path)
            if place.leading_comments:
                self.leading[path] = place.leading_comments

    def lines(self, *path):
        """As they stand, without the space behind the slashes."""
        text = self.leading.get(path, "")
        return [line[1:] if line.startswith(" ") else line
                for line in text.rstrip("\n").split("\n")]

    def words(self, *path):
        """On one line, for a table."""
        return escaped(" ".join(" ".join(self.lines(*path)).split()))

    def head(self):
        """What the file says of itself."""
        return "\n".join(self.lines(SYNTAX))


def escaped(text):
    return text.replace("|", "\\|").replace("<", "&lt;")


def type_of(field):
    """A field's type, linked where it is on the page."""
    if field.type in (Field.TYPE_MESSAGE, Field.TYPE_ENUM):
        name = field.type_name.rsplit(".", 1)[-1]
        word = (f"[{name}](#{name.lower()})"
                if field.type_name.startswith(".fathom.") else
                field.type_name.lstrip("."))
    else:
        word = Field.Type.Name(field.type)[len("TYPE_"):].lower()
    if field.label == Field.LABEL_REPEATED:
        return "repeated " + word
    return "optional " + word if field.proto3_optional else word


def service_text(service, index, comments):
    yield f"## {service.name}\n"
    yield "\n".join(comments.lines(SERVICE, index)) + "\n"
    for number, method in enumerate(service.method):
        def message(full_name, streamed):
            name = full_name.rsplit(".", 1)[-1]
            return ("stream of " if streamed else "") + (
                f"[{name}](#{name.lower()})")
        yield f"### {method.name}\n"
        yield (message(method.input_type, method.client_streaming) + " → "
               + message(method.output_type, method.server_streaming) + "\n")
        yield escaped("\n".join(comments.lines(SERVICE, index, METHOD, number))
                      ) + "\n"


def message_text(message, index, comments):
    yield f"### {message.name}\n"
    yield escaped("\n".join(comments.lines(MESSAGE, index))) + "\n"
    if not message.field:
        yield "No fields.\n"
        return
    rows = ["| # | field | type | |", "|---|---|---|---|"]
    for number, field in enumerate(message.field):
        words = comments.words(MESSAGE, index, FIELD, number)
        if field.HasField("oneof_index") and not field.proto3_optional:
            words = f"One of `{message.oneof_decl[field.oneof_index].name}`. " \
                + words
        rows.append(f"| {field.number} | `{field.name}` | {type_of(field)} | "
                    f"{words} |")
    yield "\n".join(rows) + "\n"


def enum_text(enum, index, comments):
    yield f"### {enum.name}\n"
    yield escaped("\n".join(comments.lines(ENUM, index))) + "\n"
    rows = ["| # | value | |", "|---|---|---|"]
    for number, value in enumerate(enum.value):
        rows.append(f"| {value.number} | `{value.name}` | "
                    f"{comments.words(ENUM, index, VALUE, number)} |")
    yield "\n".join(rows) + "\n"


def page_of(files):
    parts = ["# The contract: every call, message and field\n",
             "Generated from the comments in `proto/fathom/v1` by "
             "`proto/api_page.py`; do not\nedit. Errors with their reasons: "
             "[errors.md](errors.md).\n"]
    for file in files:
        comments = Comments(file)
        title = file.name.rsplit("/", 1)[-1]
        parts.append(f"# {title}\n")
        parts.append("```text\n" + comments.head() + "\n```\n")
        for i, service in enumerate(file.service):
            parts += service_text(service, i, comments)
        parts.append(f"## Messages of {title}\n")
        for i, message in enumerate(file.message_type):
            if message.nested_type or message.enum_type:
                raise NotImplementedError(f"{message.name}: nested types")
            parts += message_text(message, i, comments)
        for i, enum in enumerate(file.enum_type):
            parts += enum_text(enum, i, comments)
    return re.sub(r"[ \t]+\n", "\n", "\n".join(parts))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--proto-root", default=ROOT / "proto",
                        type=pathlib.Path)
    arguments = parser.parse_args()
    page = page_of(read_contract(arguments.proto_root))
    if not arguments.check:
        PAGE.write_text(page, encoding="utf-8")
        return 0
    if PAGE.is_file() and PAGE.read_text(encoding="utf-8") == page:
        return 0
    print("docs/api.md is not what the contract says: run proto/api_page.py")
    return 1


if __name__ == "__main__":
    sys.exit(main())
