"""The description of /api/v1: whether it is OpenAPI, whether answers are as it says, and how much of it was seen."""

import http.client
import json
import re
import time
from urllib.parse import quote

from jsonschema import Draft202012Validator, RefResolver

from hall import Answer, some_address


def form(required, /, **properties):
    return {"type": "object", "required": required.split(), "properties": properties,
            "patternProperties": {"^x-": {}}, "additionalProperties": False}


def every(schema, pattern=".*"):
    return {"type": "object", "patternProperties": {pattern: schema}, "additionalProperties": False}


TEXT, NAMES = {"type": "string", "minLength": 1}, {"type": "array", "items": {"type": "string"}}
SCHEMA = {"type": "object"}
REFERENCE = form("$ref", **{"$ref": TEXT})
CONTENT = every(form("schema", schema=SCHEMA), "^[a-z]+/[a-z.+-]+$")
RESPONSE = form("description", description=TEXT, content=CONTENT, headers=every(form("schema", schema=SCHEMA)))
PARAMETER = form("name in schema", name=TEXT, description=TEXT, required={"type": "boolean"}, schema=SCHEMA,
                 **{"in": {"enum": ["path", "query"]}})
OPERATION = form("operationId tags summary security responses", operationId=TEXT, tags=NAMES, summary=TEXT,
                 description=TEXT, security={"type": "array", "items": every(NAMES)},
                 parameters={"type": "array", "items": PARAMETER},
                 requestBody=form("required content", required={"type": "boolean"}, content=CONTENT),
                 responses={**every({"oneOf": [REFERENCE, RESPONSE]}, "^[1-5][0-9][0-9]$"), "minProperties": 1})
SECURITY = form("type", type={"enum": ["apiKey", "http"]}, name=TEXT, scheme=TEXT, description=TEXT, **{"in": TEXT})
# What we use of OpenAPI 3.1: Debian has no schema of it.
OPENAPI = form("openapi info servers tags paths components", openapi={"const": "3.1.0"},
               info=form("title version", title=TEXT, version=TEXT, description=TEXT,
                         license=form("name", name=TEXT, identifier=TEXT)),
               servers={"type": "array", "items": form("url", url=TEXT)},
               tags={"type": "array", "items": form("name", name=TEXT)},
               paths=every({**every(OPERATION, "^(get|put|post|patch|delete)$"), "minProperties": 1}, "^/"),
               components=form("schemas responses securitySchemes", schemas=every(SCHEMA, r"^[\w.-]+$"),
                               responses=every(RESPONSE, r"^[\w.-]+$"), securitySchemes=every(SECURITY)))


def parts(value, found=lambda part: True):
    """All objects in a value that `found` takes."""
    if isinstance(value, dict) and found(value):
        yield value
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from parts(inner, found)


def faults(whole):
    """What is wrong with a description, as sentences."""
    told = [f"{'/'.join(map(str, error.absolute_path))}: {error.message}"
            for error in Draft202012Validator(OPENAPI).iter_errors(whole)]
    if told:
        return told
    refers = [part["$ref"] for part in parts(whole, lambda part: isinstance(part.get("$ref"), str))]
    there = {f"#/components/{kind}/{name}" for kind in ("schemas", "responses") for name in whole["components"][kind]}
    told += [f"{ref} is not there" for ref in set(refers) - there]
    told += [f"nobody refers to {ref}" for ref in there - set(refers)]
    for part in parts(whole, lambda part: isinstance(part.get("schema"), dict)):
        Draft202012Validator.check_schema(part["schema"])
    for schema in whole["components"]["schemas"].values():
        Draft202012Validator.check_schema(schema)
    names, tags = [], {tag["name"] for tag in whole["tags"]}
    for path, item in whole["paths"].items():
        for method, operation in item.items():
            names.append(operation["operationId"])
            described = sorted(one["name"] for one in operation.get("parameters", []) if one["in"] == "path")
            if described != sorted(re.findall(r"{(\w+)}", path)):
                told.append(f"{method} {path} describes the names {described}")
            if not set(operation["tags"]) <= tags:
                told.append(f"{method} {path} has an unknown tag")
    told += [f"{name} is there twice" for name in set(names) if names.count(name) > 1]
    return told


def close(schema):
    """Only what is described may be there. Answers may gain fields, but then somebody has to describe them."""
    for part in parts(schema, lambda part: "object" in str(part.get("type")) and "properties" in part):
        part.setdefault("additionalProperties", False)


class Described:
    """shared: (status, code) of errors that are the same for all operations, and count once."""

    def __init__(self, whole, shared):
        self.whole, self.shared = json.loads(json.dumps(whole)), shared
        close(self.whole)
        self.resolver = RefResolver("", self.whole)
        self.answered, self.seen = set(), set()

    def operations(self):
        for path, item in self.whole["paths"].items():
            for method, operation in item.items():
                yield method.upper(), path, operation

    def responses(self, method, path):
        found = self.whole["paths"][path][method.lower()]["responses"]
        return {int(status): self.resolver.resolve(one["$ref"])[1] if "$ref" in one else one
                for status, one in found.items()}

    def codes(self, response):
        schema = response.get("content", {}).get("application/json", {}).get("schema", {})
        return schema["allOf"][1]["properties"]["error"]["properties"]["code"]["enum"] if "allOf" in schema else []

    def error(self, method, path, status, code):
        return ("any", "operation", status, code) if (status, code) in self.shared else (method, path, status, code)

    def errors(self):
        """All that are described: (method, path, status, code)."""
        return {self.error(method, path, status, code) for method, path, _ in self.operations()
                for status, response in self.responses(method, path).items() for code in self.codes(response)}

    def take(self, method, path, answer):
        """Checks an answer, which counts as seen. What is wrong with it; "": nothing."""
        response = self.responses(method, path).get(answer.status)
        if not response:
            return f"the status {answer.status} is not described"
        kind = (answer.headers.get("Content-Type") or "").split(";")[0]
        contents = response.get("content", {})
        if answer.status < 400:
            self.answered.add((method, path))
        if not contents:
            return f"there is a body of {len(answer.bytes)} bytes" if answer.bytes else ""
        if kind not in contents:
            return f"the content type {kind} is not described"
        if kind != "application/json":
            return ""
        value = json.loads(answer.bytes)
        if answer.status >= 400:
            self.seen.add(self.error(method, path, answer.status, value["error"]["code"]))
            if not re.fullmatch("[1-9][0-9]*", answer.headers.get("Retry-After") or "1"):
                return "Retry-After is no number of seconds"
        errors = Draft202012Validator(contents[kind]["schema"], resolver=self.resolver).iter_errors(value)
        return "; ".join(f"{'/'.join(map(str, error.absolute_path))}: {error.message[:200]}" for error in errors)


class Asker:
    """Requests to one server, from one address over a connection that is kept. Answers are compared with the
    description."""

    def __init__(self, test, described, port, trust):
        self.test, self.described, self.port, self.trust = test, described, port, trust
        self.source, self.connection, self.asked = some_address(), None, 0

    def others(self, count):
        """From the same address, with connections of their own, which end with the test."""
        for _ in range(count):
            other = Asker(self.test, self.described, self.port, self.trust)
            other.source = self.source
            self.test.addCleanup(other.close)
            yield other

    def connect(self):
        self.connection = http.client.HTTPSConnection("127.0.0.1", self.port, context=self.trust, timeout=240,
                                                      source_address=(self.source, 0))

    def close(self):
        if self.connection:
            self.connection.close()
            self.connection = None

    def send(self, method, path, body=None, headers=None):
        """The answer; path: also with a query."""
        text = json.dumps(body) if isinstance(body, (dict, list)) else body
        self.asked += 1
        was_there = self.connection
        if not was_there:
            self.connect()
        try:
            self.connection.request(method, "/api/v1" + path, text, headers or {})
            answer = Answer(self.connection.getresponse())
        except OSError:
            self.close()
            if not was_there:
                raise
            return self.send(method, path, body, headers)  # the server had closed it meanwhile
        if answer.headers.get("Connection") == "close":
            self.close()
        return answer

    def ask(self, method, path, body=None, who=None, status=None, code=None, query="", headers=None, **names):
        """An operation with names for its path. who: headers; status and the code of an error: what must come."""
        where = path.format(**{name: quote(str(value), safe="") for name, value in names.items()}) + query
        for _ in range(20):
            answer = self.send(method, where, body, {**(who or {}), **(headers or {})})
            wrong = self.described.take(method, path, answer)
            self.test.assertEqual(wrong, "", (method, where, answer.status, answer.bytes[:300]))
            if answer.status != 429 or answer.code != "too_fast":
                break
            time.sleep(int(answer.headers["Retry-After"]))
        if status:
            told = (answer.status, answer.code if code and answer.status >= 400 else None)
            self.test.assertEqual(told, (status, code), (method, where, body, answer.bytes[:300]))
        return answer
