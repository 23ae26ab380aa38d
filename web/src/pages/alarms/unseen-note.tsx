import { alarmApi } from "../../api/alarms";
import { useQuery } from "../../hooks/use-query";
import { Link } from "../../router/link";
import { plural } from "../../words/numbers";

const INTERVAL_MS = 30_000;

/** Tells of faults that healed before anybody acknowledged them, unless they are in the list. */
export function UnseenNote({ isListed }: { isListed: boolean }) {
  const fetch = () => alarmApi.allAlarms({ state: "all", acknowledged: false });
  const { data } = useQuery(fetch, "unseen", INTERVAL_MS);
  const n = data?.filter(({ status, code }) => status === "healed" && code !== "communication_lost").length;
  if (isListed || !n) return null;
  return (
    <p class="note">
      {plural(n, "fault")} healed before anybody acknowledged {n > 1 ? "them" : "it"}: enough sessions without{" "}
      {n > 1 ? "them" : "it"} followed. <Link to="/alarms?state=all&acknowledged=false">Show all</Link>
    </p>
  );
}
