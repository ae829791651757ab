// Which of several sensors the page shows. Where there is only one the chooser stays hidden.

const LOOK_MS = 3000;

/** Fill `select` with the sensors of this server, and go to the page of the one that is chosen. */
export function offerSensors(select) {
  const key = location.pathname.split("/").at(-2);
  const look = async () => {
    const answer = await fetch("../sensors").catch(() => null);
    const sensors = answer?.ok ? await answer.json() : [];
    if (sensors.length < 2) return;
    show(select, key, sensors);
    setTimeout(look, LOOK_MS);
  };
  select.addEventListener("change", () => { location.href = `../${select.value}/${location.hash}`; });
  look();
}

function show(select, key, sensors) {
  const texts = sensors.map(({ sensor, error }) => (error ? `${sensor} (failed)` : sensor));
  const shown = [...select.options].map((option) => option.text);
  if (texts.join("\n") !== shown.join("\n")) {
    select.replaceChildren(...sensors.map((each, number) => new Option(texts[number], each.key, false, each.key === key)));
  }
  sensors.forEach(({ error }, number) => { select.options[number].title = error ?? ""; });
  select.hidden = false;
}
