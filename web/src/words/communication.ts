/** Words about data of a rig that stay away. */
import type { CommunicationLine } from "../api/types";
import { dateTime } from "./time";

/** What an event tells: in a few words, with the class of their look, and as a sentence. */
export function communicationText({ status, session, since }: CommunicationLine) {
  const last = dateTime(since);
  if (status === "confirmed")
    return {
      text: "stopped",
      look: "status-confirmed",
      sentence: `No data since ${last}, though a session is open.`,
    };
  if (session == null)
    return {
      text: "no longer expected",
      look: "quiet",
      sentence: "The session has ended: no data are expected.",
    };
  return {
    text: "back",
    look: "status-passed",
    sentence: `Data arrive again. There were none since ${last}.`,
  };
}
