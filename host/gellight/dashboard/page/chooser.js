// Goes to the pages of the other sensors that run on this computer. Where there is none the chooser stays hidden.

const LOOK_MS = 3000;

/** Fill `select` with the sensors that have a page, and go to the page of the one that is chosen. */
export function offerSensors(select) {
  const look = async () => {
    const answer = await fetch("sensors").catch(() => null);
    show(select, Object.entries(answer?.ok ? await answer.json() : {}));
    setTimeout(look, LOOK_MS);
  };
  select.addEventListener("change", () => { location.href = `${select.value}${location.hash}`; });
  look();
}

function show(select, sensors) {
  select.hidden = sensors.length < 2;
  const shown = [...select.options].map((option) => option.value);
  if (sensors.map(([, page]) => page).join() === shown.join()) return;
  const isHere = (page) => new URL(page).origin === location.origin;
  select.replaceChildren(...sensors.map(([name, page]) => new Option(name, page, false, isHere(page))));
}
