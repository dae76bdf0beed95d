"""A provider of OpenID Connect, written from OpenID Connect Core 1.0, Discovery 1.0 and RFC 7636."""

import base64
import hashlib
import http.server
import json
import os
import signal
import ssl
import sys
import threading
import time
import urllib.parse
import uuid

CLIENT, SECRET = "arthron of st. mary's", "p@ss:word/+%"


def base64url(data):
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


class Provider(http.server.ThreadingHTTPServer):
    """Signs in `person` at once. `claims` replace those of an ID token (None: leaves one out), `said` what it says of
    itself. `hang`: it answers no request before `released`."""

    daemon_threads = True

    def __init__(self, folder, port):
        self.issuer = f"https://127.0.0.1:{port}/realms/ward"
        self.person, self.claims, self.said = {"preferred_username": "grace"}, {}, {}
        self.secret, self.takes_post, self.id_token = SECRET, False, None
        self.answer_bytes, self.hang, self.released = None, False, threading.Event()
        self.codes, self.asked, self.wrong = {}, [], []
        super().__init__(("127.0.0.1", port), Answer)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(os.path.join(folder, "server.pem"), os.path.join(folder, "server.key"))
        self.socket = context.wrap_socket(self.socket, server_side=True, do_handshake_on_connect=False)
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def handle_error(self, request, client_address):
        pass  # the other side went away

    def end(self):
        self.released.set()
        self.shutdown()
        self.server_close()

    def discovery(self):
        ways = ["client_secret_post"] if self.takes_post else ["client_secret_basic", "client_secret_post"]
        return {"issuer": self.issuer, "authorization_endpoint": self.issuer + "/authorize?tenant=1",
                "token_endpoint": self.issuer + "/token", "token_endpoint_auth_methods_supported": ways,
                "response_types_supported": ["code"], **self.said}

    def authorize(self, query):
        """Where the browser goes to: as if the person had typed their password here."""
        wanted = {"tenant": "1", "response_type": "code", "client_id": CLIENT, "code_challenge_method": "S256",
                  "prompt": "login"}
        if any(query.get(key) != value for key, value in wanted.items()) or "openid" not in query["scope"].split() or \
                min(len(query[key]) for key in ("state", "nonce", "code_challenge")) < 43:
            self.wrong.append(query)
        code = base64url(os.urandom(900))  # some are as long
        self.codes[code] = query
        back = {"code": code, "state": query["state"], "iss": self.issuer, "session_state": str(uuid.uuid4())}
        return query["redirect_uri"] + "?" + urllib.parse.urlencode(back)

    def is_client(self, authorization, form):
        if self.secret is None:
            return not authorization and form["client_id"] == CLIENT and "client_secret" not in form
        if self.takes_post:
            return not authorization and (form["client_id"], form["client_secret"]) == (CLIENT, self.secret)
        pair = ":".join(urllib.parse.quote(part, safe="") for part in (CLIENT, self.secret))
        return authorization == "Basic " + base64.b64encode(pair.encode()).decode() and "client_secret" not in form

    def token(self, authorization, form):
        """The status and the answer to a code."""
        if not self.is_client(authorization, form):
            return 401, {"error": "invalid_client"}
        begun = self.codes.pop(form["code"], None)
        challenge = base64url(hashlib.sha256(form["code_verifier"].encode()).digest())
        if not begun or form["grant_type"] != "authorization_code" or challenge != begun["code_challenge"] or \
                form["redirect_uri"] != begun["redirect_uri"]:
            return 400, {"error": "invalid_grant"}
        now = int(time.time())
        claims = {"iss": self.issuer, "aud": CLIENT, "sub": "1", "iat": now, "exp": now + 300, "nonce": begun["nonce"],
                  **self.person, **self.claims}
        parts = {"alg": "RS256"}, {key: value for key, value in claims.items() if value is not None}
        signed = ".".join([*(base64url(json.dumps(part).encode()) for part in parts), base64url(os.urandom(256))])
        return 200, {"access_token": "a", "token_type": "Bearer", "id_token": self.id_token or signed}


class Answer(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def say(self, status, answer):
        provider = self.server
        provider.asked.append(self.path)
        if provider.hang:
            provider.released.wait()
        body = json.dumps(answer).encode() if provider.answer_bytes is None else provider.answer_bytes
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_GET(self):
        place = urllib.parse.urlparse(self.path)
        if self.path == "/realms/ward/.well-known/openid-configuration":
            return self.say(200, self.server.discovery())
        if place.path != "/realms/ward/authorize":
            return self.say(404, {})
        self.send_response(302)
        self.send_header("Location", self.server.authorize(dict(urllib.parse.parse_qsl(place.query))))
        self.send_header("Content-Length", "0")
        self.end_headers()

    def do_POST(self):
        form = dict(urllib.parse.parse_qsl(self.rfile.read(int(self.headers["Content-Length"])).decode()))
        if self.path != "/realms/ward/token":
            return self.say(404, {})
        self.say(*self.server.token(self.headers["Authorization"], form))


if __name__ == "__main__":  # FOLDER PORT: until it is ended
    Provider(sys.argv[1], int(sys.argv[2]))
    signal.pause()
