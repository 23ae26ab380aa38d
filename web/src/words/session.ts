import type { Session } from "../api/types";

/** Time from the first to the last sample, s; null without samples. */
export const sessionLength = ({ first_t_s, last_t_s }: Session) =>
  first_t_s != null && last_t_s != null ? last_t_s - first_t_s : null;
