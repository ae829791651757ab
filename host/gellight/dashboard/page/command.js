// What the page asks the sensor's program for.

export const SILENT = "the sensor's program does not answer";

/** Ask the sensor to do `call`, one of daemon/calls.py; return "" when it is done, else why not. */
export function command(call) {
  const headers = { "Content-Type": "application/json" };
  return ask("command", () => {}, { method: "POST", headers, body: JSON.stringify(call) });
}

/** Save what the server has at `address`; return "" or why there is none, which a link alone would not say. */
export function fetchFile(address) {
  return ask(address, async (answer) => {
    download(await answer.blob(), answer.headers.get("Content-Disposition").match(/"(.*)"/)[1]);
  });
}

/** Let `take(answer)` have what the server has at `address`; return "" or why there is none. */
export async function ask(address, take, options) {
  try {
    const answer = await fetch(address, options);
    if (!answer.ok) return (await answer.json()).message;
    await take(answer);
    return "";
  } catch {
    return SILENT;
  }
}

/** Save `blob` as a file. */
export function download(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
