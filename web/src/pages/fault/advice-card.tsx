import { alarmApi } from "../../api/alarms";
import type { FaultEntry } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { ErrorMessage } from "../../parts/error-message";
import { WhatToDo } from "../alarms/what-to-do";

/** What to do about a fault that is on record. */
export function AdviceCard({ fault }: { fault: FaultEntry }) {
  const { data: advice, error, refetch } = useQuery(alarmApi.advice, "advice");
  if (fault.status === "cleared") return null;
  return (
    <section class="card">
      <h2>What to do</h2>
      <ErrorMessage error={error} retry={refetch} />
      {advice && <WhatToDo fault={fault} advice={advice} refetch={refetch} />}
    </section>
  );
}
