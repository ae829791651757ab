// What can be believed of what the page shows: one name for it.

const STALE_S = 1; // a sensor whose newest frame is older is not live
const BEHIND_S = 1; // a link that lies further behind is slow
const CALIBRATING = "A calibration is running: it does the pressing.";
const SLOW = "The link to the server is slow: what is shown is old, the sensor itself may be well.";
const PREPARING = "The gel of this press is computed once, which takes some seconds. Release gives it up.";

/**
 * Return {name, text, noPress, why}: the state, how it is called on the page, why nothing can be pressed ("" where it
 * can), and what the name does not say. What comes and goes by itself has no banner: pictures would move under a hand.
 * `connected`, `paused`; `status` of the server or null; `ageS` of the frame shown or null; `behindS` of the link.
 */
export function judge({ connected, paused, status, ageS, behindS }) {
  if (connected === undefined) return state("connecting", "connecting");
  if (!connected) return state("lost", "reconnecting", "The server is gone.");
  if (status?.calibrating) return state("calibrating", "calibrating", CALIBRATING);
  if (paused) return state("paused", "paused");
  if (behindS > BEHIND_S) return state("slow", `link ${behindS.toFixed(1)} s behind`, "", SLOW);
  if (status?.stage?.preparing) return state("preparing", "preparing", "", PREPARING);
  if (ageS === null) return state("connected", "connected");
  return ageS > STALE_S ? state("stale", `no frame ${ageS.toFixed(1)} s`) : state("live", "live");
}

function state(name, text, noPress = "", why = "") {
  return { name, text, noPress, why };
}
