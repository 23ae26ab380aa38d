import type { Session } from "../api/types";

/** Time from the first to the last sample, s; null without samples. */
export const sessionLength = ({ first_t_s, last_t_s }: Session) =>
  first_t_s != null && last_t_s != null ? last_t_s - first_t_s : null;

/** What a device does after somebody has ended its session. */
export const AFTER_THE_END =
  "A device that names no session goes on in a new one with its next sample, and so do the clients that come " +
  "with offbd. Another device that names its session must name a new one, or be restarted.";
