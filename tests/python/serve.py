"""A client of `mms serve --mcp`: python serve.py MMS

It lists, derives, generates, checks and scores; then it sends what no client should, and asks for files that it was not given.
"""

import json
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

MMS = str(Path(sys.argv[1]).resolve())
# The server's own limit on silence; a hang ends the test.
LIMIT_S = 120


class Client:
    def __init__(self, *options):
        self.process = subprocess.Popen([MMS, "serve", "--mcp", *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.last = 0

    def send(self, line):
        self.process.stdin.write(line if isinstance(line, bytes) else line.encode())
        self.process.stdin.write(b"\n")
        self.process.stdin.flush()

    def receive(self):
        alarm = threading.Timer(LIMIT_S, self.process.kill)
        alarm.start()
        line = self.process.stdout.readline()
        alarm.cancel()
        assert line, "the server ended"
        return json.loads(line)

    def ask(self, method, params=None):
        self.last += 1
        request = {"jsonrpc": "2.0", "id": self.last, "method": method}
        self.send(json.dumps(request if params is None else {**request, "params": params}))
        answer = self.receive()
        assert answer["jsonrpc"] == "2.0" and answer["id"] == self.last, answer
        return answer

    def call(self, name, **arguments):
        answer = self.ask("tools/call", {"name": name, "arguments": arguments})
        assert "result" in answer, answer
        result = answer["result"]
        if result["isError"]:
            return None, result["content"][0]["text"]
        assert json.loads(result["content"][0]["text"]) == result["structuredContent"]
        return result["structuredContent"], None

    def code(self, name, **arguments):
        return self.ask("tools/call", {"name": name, "arguments": arguments})["error"]["code"]

    def end(self):
        self.process.stdin.close()
        assert self.process.wait(LIMIT_S) == 0


def done(pair):
    found, why = pair
    assert why is None, why
    return found


def refused(pair, *words):
    found, why = pair
    assert found is None, found
    for word in words:
        assert word in why, why
    return why


def fits(value, schema):
    """Whether a document has the keys that its schema requires, and no others."""
    assert set(schema["required"]) <= set(value), set(schema["required"]) - set(value)
    if schema["additionalProperties"] is False:
        assert set(value) <= set(schema["properties"]), set(value) - set(schema["properties"])


def tools(client, folder):
    begun = client.ask("initialize", {"protocolVersion": "2025-03-26", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}})["result"]
    assert begun["protocolVersion"] == "2025-03-26" and begun["serverInfo"]["name"] == "mmsmith"
    client.send(json.dumps({"jsonrpc": "2.0", "method": "notifications/initialized"}))
    assert client.ask("ping")["result"] == {}
    offered = {tool["name"]: tool for tool in client.ask("tools/list")["result"]["tools"]}
    assert set(offered) == {"list", "explain", "check", "derive", "gen", "score"}, set(offered)
    for tool in offered.values():
        assert tool["description"] and tool["inputSchema"]["type"] == "object", tool

    names = [row["name"] for row in done(client.call("list"))["rows"]]
    assert {"ring", "swirl", "bar-j2", "thick-cylinder"} <= set(names)
    for name in ("list", "explain", "check"):
        arguments = {} if name == "list" else {"solution": "axis-aligned-1d"}
        fits(done(client.call(name, **arguments)), offered[name]["outputSchema"])
    assert done(client.call("check", solution="axis-aligned-1d", set={"A": 0.05}, points=50))["passed"] is True

    derived = done(client.call("derive", solution="ring"))
    assert len(derived["b"]) == 2 and len(derived["P"]) == 2 and "R" in derived["where"], derived

    text = done(client.call("gen", solution="bar", target="numpy"))["files"][0]["text"]
    direct = folder / "direct"
    subprocess.run([MMS, "gen", "bar", "--target", "numpy", "--out", direct], check=True, stdout=subprocess.DEVNULL)
    assert text == (direct / "bar_numpy.py").read_text()
    written = done(client.call("gen", solution="bar", target="c", set={"A": 0.02}, out="made/here"))["files"][0]
    assert (folder / "made/here/bar.h").read_text() and "text" not in written
    wrong = done(client.call("gen", solution="bar", target="c", fault="body-force-sign"))["files"][0]["text"]
    assert "WRONG ON PURPOSE" in wrong

    own = (folder / "own.toml").read_text()
    for subject in ({"text": own}, {"solution": "own.toml"}, {"solution": str(folder / "own.toml")}):
        assert done(client.call("derive", **subject))["solution"] == "own"

    for cells in (16, 32):
        recording = folder / f"run-{cells}"
        subprocess.run([MMS, "run", "bar", "--cells", str(cells), "--frames", "4", "--vtk", recording], check=True, stdout=subprocess.DEVNULL)
    score = done(client.call("score", solution="bar", files=["run-16/bar.pvd", "run-32/bar.pvd"], cells=[16, 32], expect="u=2"))
    fits(score, offered["score"]["outputSchema"])


OWN = """name = 'own'
title = 'A bar'
coordinates = 'cartesian'
dimension = 1
[parameters]
A = { default = 0.01 }
E = { default = 1.0e4, range = '> 0' }
rho0 = { default = 4.0, range = '> 0' }
[displacement]
X = 'A*sin(Pi*X)*cos(Pi*t*sqrt(E/rho0))'
[material]
law = 'neo-hookean'
lambda = 0
mu = 'E/2'
density = 'rho0'
[domain]
shape = 'box'
lower = [0]
upper = [1]
[time]
period = '2*sqrt(rho0/E)'
"""


def hostile(client, folder):
    for line, code in [
        ("{", -32700), ("nonsense", -32700), (b"\xff\xfe", -32700), ("[" * 100_000, -32700), ('{"a": 1e999}', -32700),
        ("[]", -32600), ("1", -32600), ('"text"', -32600), ("null", -32600), ("{}", -32600),
        ('{"jsonrpc": "1.0", "id": 1, "method": "ping"}', -32600), ('{"jsonrpc": "2.0", "id": 1}', -32600),
        ('{"jsonrpc": "2.0", "id": {}, "method": "ping"}', -32600), ('{"jsonrpc": "2.0", "id": 1, "method": 5}', -32600),
        ('{"jsonrpc": "2.0", "id": 1, "method": "no/method"}', -32601), ('{"jsonrpc": "2.0", "id": 1, "method": "tools/call"}', -32602),
        ('{"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": []}', -32602),
        ('{"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": {"name": "list", "arguments": 5}}', -32602),
        ("x" * (33 << 20), -32600),
    ]:
        client.send(line)
        answer = client.receive()
        assert answer["error"]["code"] == code, (line[:80], answer)
    # Notifications have no answer, whatever they say.
    for line in ['{"jsonrpc": "2.0", "method": "ping"}', '{"jsonrpc": "2.0", "method": "tools/call", "params": {"name": "rm"}}', "", "   "]:
        client.send(line)
    assert client.ask("ping")["result"] == {}

    assert client.code("shell") == -32602
    assert client.code("diagnose", solution="bar", target="c") == -32602
    assert client.code("list", path="/") == -32602
    assert client.code("derive") == -32602
    assert client.code("derive", solution="bar", text=OWN) == -32602
    assert client.code("derive", solution=5) == -32602
    assert client.code("gen", solution="bar") == -32602
    assert client.code("check", solution="bar", points=-1) == -32602
    assert client.code("check", solution="bar", set={"A": "x"}) == -32602

    outside = folder.parent / "outside"
    outside.mkdir()
    (outside / "secret.toml").write_text(OWN)
    (folder / "link.toml").symlink_to(outside / "secret.toml")
    (folder / "linked").symlink_to(outside)
    for path in ("../outside/secret.toml", str(outside / "secret.toml"), "link.toml", "linked/secret.toml", "/etc/passwd", "/etc/passwd.toml", "own.toml/../../outside/secret.toml"):
        why = refused(client.call("derive", solution=path))
        assert "no file of the folders" in why or "in the library" in why, why
    for out in ("../outside", str(outside), "linked", "linked/deeper", "/tmp", "made/../../outside", "x/../../outside/y"):
        refused(client.call("gen", solution="bar", target="c", out=out), "not in the folders")
    assert [entry.name for entry in outside.iterdir()] == ["secret.toml"]
    (folder / "trap").mkdir()
    (folder / "trap/bar.h").symlink_to(outside / "bar.h")
    refused(client.call("gen", solution="bar", target="c", out="trap"), "link")
    # A list of frames that leads elsewhere, and a listing beside a specification.
    (folder / "bad.pvd").write_text('<VTKFile type="Collection"><Collection><DataSet timestep="0" file="../outside/secret.toml"/></Collection></VTKFile>')
    refused(client.call("score", solution="bar", files=["bad.pvd"]))
    refused(client.call("score", solution="bar", files=["/etc/passwd"]), "no file of the folders")
    refused(client.call("score", solution="bar", files=["run-16"]), "no file of the folders")
    listing = OWN + "[[cross-check]]\nsource = 'elsewhere'\nfile = '../outside/secret.toml'\n"
    refused(client.call("check", text=listing))

    refused(client.call("derive", text="name = "), "specification.toml:1")
    refused(client.call("derive", text="x" * (5 << 20)), "longer")
    refused(client.call("derive", solution="no-such"), "no solution 'no-such'")
    refused(client.call("gen", solution="bar", target="klingon"))
    refused(client.call("gen", solution="bar", target="c", set={"A": 1e308}))
    refused(client.call("score", solution="bar", files=["own.toml"]))
    refused(client.call("score", solution="bar", files=["run-16/bar.pvd"], expect="--json=/elsewhere.json"))
    assert client.ask("ping")["result"] == {}


with tempfile.TemporaryDirectory() as place:
    folder = Path(place).resolve() / "given"
    folder.mkdir()
    (folder / "own.toml").write_text(OWN)
    client = Client("--folder", str(folder))
    tools(client, folder)
    hostile(client, folder)
    client.end()

    # Without a folder texts go both ways.
    client = Client()
    assert done(client.call("gen", text=OWN, target="c"))["files"][0]["name"] == "own.h"
    refused(client.call("gen", text=OWN, target="c", out="."), "no folder to write to")
    refused(client.call("derive", solution=str(folder / "own.toml")), "no file of the folders")
    client.end()

    # The solver that the server may run is the server's own.
    client = Client("--run", "false")
    assert any(tool["name"] == "diagnose" for tool in client.ask("tools/list")["result"]["tools"])
    refused(client.call("diagnose", solution="bar", target="c", cells=[4, 8]))
    assert client.code("diagnose", solution="bar", target="c", run="id") == -32602
    client.end()
print("the server answers what it should, and refuses the rest")
