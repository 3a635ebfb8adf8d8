"""Model Context Protocol server of commands, asked by the client of the protocol's own package."""

import sys

import pytest
from command_line import FREE

pytest.importorskip("mcp", reason="the extra mcp is not installed")
anyio = pytest.importorskip("anyio")


def test_a_client_lists_the_tools_runs_a_scene_and_reads_its_certificate(tmp_path):
    from mcp import Client, StdioServerParameters, stdio_client

    (tmp_path / "free.toml").write_text(FREE)
    scene, output = str(tmp_path / "free.toml"), str(tmp_path / "out")
    given = StdioServerParameters(command=sys.executable, args=["-m", "clothsim.cli.tool_server"])

    async def ask():
        async with Client(stdio_client(given)) as client:
            assert {tool.name for tool in (await client.list_tools()).tools} == {"check", "run", "certificate", "keys"}
            checked = await client.call_tool("check", {"target": scene})
            assert checked.structured_content["code"] == 0
            summary = await client.call_tool("run", {"scene": scene, "output": output, "settings": []})
            assert summary.structured_content["status"] == "completed"
            said = await client.call_tool("certificate", {"run_directory": output})
            assert said.structured_content["certificate"] == summary.structured_content["certificate"]
            key = await client.call_tool("keys", {"section": "solver.dt"})
            assert key.structured_content["solver"]["keys"]["dt"]["unit"] == "s"
            for name, arguments in (
                ("check", {"target": "nothing.toml"}),
                ("check", {"target": "--help"}),
                ("check", {"target": "a\0b"}),
            ):
                assert (await client.call_tool(name, arguments)).is_error
            assert (await client.call_tool("certificate", {"run_directory": str(tmp_path)})).is_error

    anyio.run(ask)
