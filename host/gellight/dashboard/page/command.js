// The one way in which the page asks for something: a call of daemon/calls.py.

/** Ask the sensor to do `call`; return "" when it is done, else why not. */
export async function command(call) {
  try {
    const answer = await fetch("command", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(call) });
    return answer.ok ? "" : (await answer.json()).message;
  } catch {
    return "the sensor's program does not answer";
  }
}
