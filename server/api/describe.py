#!/usr/bin/env python3
"""Makes of openapi.yaml what the build and the documentation need:

describe.py FOLDER             writes routes.inc, openapi.json, and the latter as openapi.c
describe.py --check API.md     compares the tables of the documentation with it; exits 1 and says how they differ
describe.py --write API.md     writes these tables
"""

import difflib
import json
import os
import re
import sys

import yaml

HERE = os.path.dirname(os.path.abspath(__file__))
METHODS = ("get", "put", "post", "patch", "delete")
PEOPLE = ("instructor", "technician", "trainee")
ROLES = {"instructor": "INSTRUCTOR", "technician": "TECHNICIAN", "trainee": "TRAINEE", "anyone": "ANYONE",
         "server": "SERVER", "always": "ALWAYS"}
PLACES = {None: "HERE", "station": "AT_STATION", "trace": "AT_TRACE"}


def read(name):
    with open(os.path.join(HERE, name), encoding="utf-8") as file:
        return yaml.safe_load(file)


class Source:
    """openapi.yaml and schemas.yaml as they are written."""

    def __init__(self):
        self.top, self.schemas = read("openapi.yaml"), read("schemas.yaml")
        self.named = {id(schema): name for name, schema in self.schemas.items() if "x-word" in schema}

    def operations(self):
        """(path, method, operation), in their order."""
        for path, item in self.top["paths"].items():
            for method, operation in item.items():
                if method in METHODS:
                    yield path, method, operation

    def parameters(self, path, operation):
        return self.top["paths"][path].get("parameters", []) + operation.get("parameters", [])

    def schema(self, content):
        """The schema of a body, of its reference where it has one."""
        schema = content["application/json"]["schema"]
        return self.schemas[schema["$ref"].split("/")[-1]] if "$ref" in schema else schema

    def errors(self, path, method, operation):
        """{status: codes} of an operation, also those that it shares with others."""
        roles = operation["x-role"]
        applies = {"all": True, "change": method != "get", "body": "requestBody" in operation,
                   "query": "parameters" in operation, "name": "{" in path,
                   "sign-in": not {"anyone", "always"} & set(roles),
                   "role": not {"anyone", "always"} & set(roles) and set(roles) != set(PEOPLE)}
        found = {}
        for row in self.top["x-errors"]:
            own = operation.get("x-errors", {}).get(row["status"], [])
            codes = [code for code in row["codes"] if code in own or applies.get(row.get("with"))]
            if codes:
                found.setdefault(row["status"], []).extend(codes)
        return found


# ---- the whole description --------------------------------------------------------------------------------


def plain(text):
    """A text without the links of the documentation."""
    return re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)


class Whole:
    """OpenAPI with all that the sources leave to rules."""

    def __init__(self, source):
        self.source = source
        self.used, self.responses = {}, {}
        top = source.top
        paths = {}
        for path, method, operation in source.operations():
            paths.setdefault(path, {})[method] = self.operation(path, method, operation)
        self.refer("Error")
        self.json = {"openapi": top["openapi"], "info": top["info"], "servers": top["servers"], "tags": top["tags"],
                     "paths": paths,
                     "components": {"schemas": dict(sorted(self.used.items())),
                                    "responses": dict(sorted(self.responses.items())),
                                    "securitySchemes": top["components"]["securitySchemes"]}}

    def refer(self, name):
        if name not in self.used:
            self.used[name] = None  # it may refer to itself
            self.used[name] = self.spell_out(self.source.schemas[name], False)
        return {"$ref": "#/components/schemas/" + name}

    def spell_out(self, schema, may_refer=True):
        """What has properties is an object with all of them, what has items a list."""
        if "$ref" in schema:
            return self.refer(schema["$ref"].split("/")[-1])
        if may_refer and id(schema) in self.source.named:
            return self.refer(self.source.named[id(schema)])
        out = {key: value for key, value in schema.items() if key != "x-word"}
        if "properties" in out:
            properties = {name: self.spell_out(inner) for name, inner in out["properties"].items()}
            out = {"type": "object", "required": list(properties), **out, "properties": properties}
        if "items" in out:
            out = {"type": "array", **out, "items": self.spell_out(out["items"])}
        if "oneOf" in out:
            out["oneOf"] = [self.spell_out(inner) for inner in out["oneOf"]]
        if out.get("required") == []:
            del out["required"]
        return out

    def contents(self, contents, closed=False):
        out = {kind: {"schema": self.spell_out(content["schema"])} for kind, content in contents.items()}
        if closed:  # a field that is not described is refused
            for content in out.values():
                self.used[content["schema"]["$ref"].split("/")[-1]]["additionalProperties"] = False
        return out

    def error(self, status, codes):
        """A response that all operations with these errors share."""
        name = "-".join([f"error-{status}", *codes])
        rows = [row for row in self.source.top["x-errors"]
                if row["status"] == status and set(row["codes"]) & set(codes)]
        code = {"properties": {"error": {"properties": {"code": {"enum": codes}}}}}
        response = {"description": plain(". ".join(row["when"] for row in rows)) + ".",
                    "content": {"application/json": {"schema": {"allOf": [self.refer("Error"), code]}}}}
        if status in (429, 503):
            response["headers"] = {"Retry-After": {"schema": {"type": "integer", "minimum": 1}}}
        self.responses[name] = response
        return {"$ref": "#/components/responses/" + name}

    def answers(self, path, method, operation):
        out = {}
        for status, response in operation["responses"].items():
            out[status] = {**response}
            if "content" in response:
                out[status]["content"] = self.contents(response["content"])
        for status, codes in self.source.errors(path, method, operation).items():
            shared = self.error(status, codes)
            if status not in out:
                out[status] = shared
            else:
                more = self.responses[shared["$ref"].split("/")[-1]]
                out[status] = {**more, "content": {**out[status]["content"], **more["content"]}}
        return {str(status): out[status] for status in sorted(out)}

    def security(self, roles):
        signed_in = [{"cookie": []}, {"token": []}]
        return {"always": [], "server": [{"secret": []}], "anyone": [{}, *signed_in]}.get(roles[0], signed_in)

    def operation(self, path, method, operation):
        out = {"operationId": operation["operationId"], "tags": operation["tags"],
               "summary": plain(operation["summary"])}
        if "description" in operation:
            out["description"] = plain(operation["description"])
        out.update({"x-role": operation["x-role"], "security": self.security(operation["x-role"])})
        parameters = self.source.parameters(path, operation)
        if parameters:
            out["parameters"] = parameters
        if "requestBody" in operation:
            body = self.contents(operation["requestBody"]["content"], True)
            needed = bool(self.source.schema(operation["requestBody"]["content"]).get("required", True))
            out["requestBody"] = {"required": needed, "content": body}
        out["responses"] = self.answers(path, method, operation)
        return out


def whole():
    return Whole(Source()).json


# ---- for the compiler -------------------------------------------------------------------------------------


def routes(source):
    """Rows of the server's table: ROUTE(method, path, roles, answer, slow, place)."""
    lines = ["// Made by describe.py of openapi.yaml.\n"]
    for path, method, operation in source.operations():
        row = (f'"{method.upper()}"', '"' + re.sub(r"{\w+}", "*", path) + '"',
               " | ".join(ROLES[role] for role in operation["x-role"]), operation["operationId"],
               "SLOW" if operation.get("x-slow") else "QUICK", PLACES[operation.get("x-at")])
        lines.append(f"ROUTE({', '.join(row)})\n")
    return "".join(lines)


def as_c(text):
    pieces = (text[i:i + 100] for i in range(0, len(text), 100))
    lines = "".join('    "%s"\n' % piece.replace("\\", "\\\\").replace('"', '\\"') for piece in pieces)
    return ("// Made by describe.py of openapi.yaml.\nextern const char api_description[];\n\n"
            f"const char api_description[] =\n{lines};\n")


def write_into(folder):
    text = json.dumps(whole(), separators=(",", ":"))
    files = {"routes.inc": routes(Source()), "openapi.json": text, "openapi.c": as_c(text)}
    for name, content in files.items():
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(content)


# ---- for the documentation --------------------------------------------------------------------------------

WHO = {("anyone",): "anybody", ("always",): "anybody", ("server",): "another server, by this one's secret"}


class Tables:
    """The tables of docs/API.md, by the words of their marks."""

    def __init__(self, source):
        self.source = source
        self.tables = {tag["name"]: self.operations(tag["name"]) for tag in source.top["tags"]}
        self.tables["objects"] = self.objects()
        self.tables["errors"] = self.errors()

    def shape(self, schema, words=True):
        """The fields of an object; empty: it is none."""
        if words and "x-word" in schema:
            return schema["x-word"]
        if "oneOf" in schema:
            return self.shape(schema["oneOf"][0])
        if "items" in schema:
            inner = self.shape(schema["items"])
            return f"[{inner}]" if inner else ""
        if "properties" not in schema:
            return ""
        return "{" + ", ".join(self.field(schema, name, inner) for name, inner in schema["properties"].items()) + "}"

    def field(self, schema, name, inner):
        shape = self.shape(inner)
        optional = "?" if name not in schema.get("required", schema["properties"]) else ""
        return name + optional + (f": {shape}" if shape else "")

    def parameter(self, parameter):
        schema = parameter["schema"]
        bounds = f"{schema['minimum']} to {schema['maximum']}" if {"minimum", "maximum"} <= set(schema) else ""
        more = "; ".join(str(part) for part in (bounds, schema.get("default")) if part)
        return f"`{parameter['name']}{'' if parameter.get('required') else '?'}`" + (f" ({more})" if more else "")

    def takes(self, operation):
        parts = [self.parameter(parameter) for parameter in operation.get("parameters", [])]
        if "requestBody" in operation:
            shape = self.shape(self.source.schema(operation["requestBody"]["content"]))
            parts += [f"`{shape}`"] if shape != "{}" else []
        return ", ".join(parts)

    def gives(self, operation):
        status, response = next(iter(operation["responses"].items()))
        is_json = "application/json" in response.get("content", {})
        shape = self.shape(self.source.schema(response["content"])) if is_json else ""
        more = f" {operation['description'].strip()}" if "description" in operation else ""
        return f"{status}{f' `{shape}`' if shape else ''}. {operation['summary']}{more}".replace("|", "\\|")

    def own_errors(self, path, operation):
        found = {*operation.get("x-errors", {}), *(status for status in operation["responses"] if status >= 400),
                 *([404] if "{" in path else [])}
        return ", ".join(str(status) for status in sorted(found))

    def operations(self, tag):
        lines = ["| request | who | body, query | answer | errors |", "|---|---|---|---|---|"]
        for path, method, operation in self.source.operations():
            if operation["tags"] != [tag]:
                continue
            roles = tuple(operation["x-role"])
            who = WHO.get(roles) or " ".join({"trainee": "o"}.get(role, role[0]) for role in roles)
            shown = re.sub(r"{(\w+)}", lambda found: found[1].upper(), path)
            lines.append(f"| `{method.upper()} {shown}` | {who} | {self.takes(operation)} | {self.gives(operation)} | "
                         f"{self.own_errors(path, operation)} |")
        return lines

    def objects(self):
        words = {schema["x-word"]: schema for schema in self.source.schemas.values() if "x-word" in schema}
        return ["| object | fields |", "|---|---|",
                *(f"| {word} | `{self.shape(schema, False)}` |" for word, schema in words.items())]

    def errors(self):
        rows = (f"| {row['status']} | {', '.join(f'`{code}`' for code in row['codes'])} | {row['when']} |"
                for row in self.source.top["x-errors"])
        return ["| status | code | when |", "|---|---|---|", *rows]

    def put_into(self, text):
        """The text of API.md with these tables between its marks."""
        for name, lines in self.tables.items():
            mark = f"<!-- made by server/api/describe.py: {name} -->\n"
            if text.count(mark) != 1:
                sys.exit(f"describe.py: the document needs one mark {mark}")
            before, rest = text.split(mark)
            rest = rest[rest.index("<!-- end -->"):]
            text = before + mark + "\n" + "\n".join(lines) + "\n\n" + rest
        return text


def document(path, write):
    with open(path, encoding="utf-8") as file:
        old = file.read()
    new = Tables(Source()).put_into(old)
    if write:
        with open(path, "w", encoding="utf-8") as file:
            file.write(new)
        return 0
    sys.stdout.writelines(difflib.unified_diff(old.splitlines(True), new.splitlines(True), path, "openapi.yaml"))
    if old != new:
        print(f"{path} is not what openapi.yaml says: run server/api/describe.py --write {path}")
    return int(old != new)


def main(words):
    if len(words) == 2 and words[0] in ("--check", "--write"):
        return document(words[1], words[0] == "--write")
    if len(words) != 1 or words[0].startswith("-"):
        sys.exit(__doc__)
    write_into(words[0])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
