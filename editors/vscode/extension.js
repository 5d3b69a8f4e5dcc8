// Starts `lingjing lsp` and connects the editor to it.
"use strict";

const vscode = require("vscode");
const { LanguageClient, TransportKind } = require("vscode-languageclient/node");

/** @type {LanguageClient | undefined} */
let client;

async function start() {
  const [command, ...args] = vscode.workspace.getConfiguration("lingjing").get("command", ["lingjing", "lsp"]);
  const run = { command, args, transport: TransportKind.stdio };
  client = new LanguageClient(
    "lingjing",
    "Lingjing",
    { run, debug: run },
    { documentSelector: [{ scheme: "file", language: "ljs" }, { scheme: "untitled", language: "ljs" }] },
  );
  try {
    await client.start();
  } catch (error) {
    client = undefined;
    const choice = await vscode.window.showErrorMessage(
      `Lingjing: \`${[command, ...args].join(" ")}\` did not start: ${error.message}. ` +
        "Install Lingjing and `pip install lsprotocol 'pygls>=2.0,<3'`, or set lingjing.command.",
      "Open settings",
    );
    if (choice) {
      await vscode.commands.executeCommand("workbench.action.openSettings", "lingjing.command");
    }
  }
}

async function stop() {
  const running = client;
  client = undefined;
  if (running) {
    await running.stop();
  }
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("lingjing.restart", async () => {
      await stop();
      await start();
    }),
    vscode.workspace.onDidChangeConfiguration(async (event) => {
      if (event.affectsConfiguration("lingjing.command")) {
        await stop();
        await start();
      }
    }),
  );
  await start();
}

module.exports = { activate, deactivate: stop };
