// What can be believed of what the page shows: one name for it, and the banners that say why.

const STALE_S = 1; // a sensor whose newest frame is older is not live
const BEHIND_S = 1; // a link that lies further behind is slow

/**
 * Return {name, text, noPress, why}: the state, how it is called on the page, why nothing can be pressed ("" where it
 * can), and what the name does not say. What comes and goes by itself has no banner: pictures would move under a hand.
 * `connected`, `paused`; `status` of the server or null; `ageS` of the frame shown or null; `behindS` of the link.
 */
export function judge({ connected, paused, status, ageS, behindS }) {
  if (connected === undefined) return state("connecting", "connecting");
  if (!connected) return state("lost", "reconnecting", "The server is gone.");
  if (status?.calibrating) return state("calibrating", "calibrating", "A calibration is running: it does the pressing.");
  if (paused) return state("paused", "paused");
  if (behindS > BEHIND_S) return state("slow", `link ${behindS.toFixed(1)} s behind`, "", "The link to the server is slow: what is shown is old, the sensor itself may be well.");
  if (status?.stage?.preparing) return state("preparing", "preparing", "", "The gel of this press is computed once, which takes some seconds. Release gives it up.");
  if (ageS === null) return state("connected", "connected");
  return ageS > STALE_S ? state("stale", `no frame ${ageS.toFixed(1)} s`) : state("live", "live");
}

function state(name, text, noPress = "", why = "") {
  return { name, text, noPress, why };
}

/** Show in `banners` what `state` and `status` say; `actions`: retry(), resume(), diagnose(). */
export function tellBanners(banners, { name }, status, { retry, resume, diagnose }) {
  const tell = (key, holds, ...banner) => (holds ? banners.show(key, ...banner) : banners.hide(key));
  tell("lost", name === "lost", "fault", "The server is gone. What is shown is what it said last.", [["Try now", retry]]);
  tell("error", Boolean(status?.error) && name !== "lost", "fault", status?.error, [["Diagnostics", diagnose]]);
  tell("calibrating", name === "calibrating", "warning", "A calibration is running. Under its light the depth means nothing.", [["Open it", "calibrate.html"]]);
  tell("paused", name === "paused", "notice", "Paused. Drag over the chart of the indentation to see earlier frames.", [["Resume", resume]]);
}
