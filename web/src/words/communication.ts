/** Words about data of a rig that stay away. */
import type { CommunicationLine } from "../api/types";
import { dateTime } from "./time";

/** What an event tells: in a few words, with the class of their look, and as a sentence. */
export function communicationText({ status, session, since }: CommunicationLine) {
  const last = dateTime(since);
  if (status === "confirmed")
    return {
      text: "lost",
      look: "status-confirmed",
      sentence: `No data arrive although a session is open. The last arrived ${last}.`,
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
    sentence: `Data arrive again. They had stayed away since ${last}.`,
  };
}
