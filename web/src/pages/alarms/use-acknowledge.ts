import { useState } from "preact/hooks";
import { alarmApi, type Alarm } from "../../api/alarms";
import { alarmKey } from "./use-alarms";

/** The alarms that are chosen, and how they are acknowledged together. */
export function useAcknowledge(alarms: Alarm[], refetch: () => Promise<unknown>) {
  const [chosen, choose] = useState(new Set<string>());
  const [refused, setRefused] = useState<string[]>([]);
  const taken = alarms.filter((alarm) => chosen.has(alarmKey(alarm)) && !alarm.acknowledgement);
  const acknowledge = async () => {
    const keys = taken.map(({ asset, code }) => ({ asset, code }));
    const { items } = await alarmApi.acknowledge(keys);
    setRefused(items.filter((item) => !item.acknowledged).map((item) => item.reason ?? ""));
    choose(new Set());
    await refetch();
  };
  return {
    chosen,
    choose,
    /** How many of the chosen ones nobody has acknowledged yet. */
    open: taken.length,
    /** Why alarms were not acknowledged. */
    refused,
    acknowledge,
  };
}
