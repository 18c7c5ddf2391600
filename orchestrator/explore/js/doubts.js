// Receivers that are for beacons or ranges of another kind than the scenario's: as `scenario/doubts.py`.

import { hasOwnErrors, sharesErrors } from "./possible.js";

/** What is wrong with each receiver, by name, or ""; `of` gives the value of a key. */
export function doubtsOf(of, { doubts, receiver_keys, contents }, facts) {
  const kind = hasOwnErrors(of, facts) ? of("platform.gps_shared") ? "survey" : "buoys"
    : sharesErrors(of, facts) ? "platform" : "";
  return Object.fromEntries(Object.entries(doubts.receivers).map(([name, { purpose, unfit }]) => {
    const [key, words] = doubts.pings[ofPings(of, receiver_keys[name], contents, doubts.inverted)] ?? [];
    const what = unfit[kind] ?? words?.replace("{}", key);
    return [name, what ? `For ${purpose}; here ${what}.` : ""];
  }));
}

// Which of `PINGS` holds for a receiver with these keys.
function ofPings(of, keys, contents, inverted) {
  const isInverted = inverted.includes(of("acoustics.ranging"));
  if (keys.includes("range_common_std_m"))
    return !isInverted ? "unheard" : contents[of("acoustics.packet_content")].only_own ? "no pose" : "";
  if (isInverted && !of("acoustics.common_clock") && !keys.includes("beacon_position_source")) return "differences";
  const isCommon = of("acoustics.range_common_std_m") > of("acoustics.range_std_m");
  return keys.includes("clock_std_m") && isInverted && isCommon ? "common" : "";
}
