/** The faults that the demo can have: `code:kind`, as the service names them. */

export interface DemoFault {
  /** What the service calls it. */
  id: string;
  code: string;
  kind: string;
}

const parse = (id: string): DemoFault => {
  const [code = "", kind = ""] = id.split(":");
  return { id, code, kind };
};

/** The faults by their code, in the order in which the service names them. */
export function faultsByCode(ids: string[]): Map<string, DemoFault[]> {
  const groups = new Map<string, DemoFault[]>();
  for (const fault of ids.map(parse)) groups.set(fault.code, [...(groups.get(fault.code) ?? []), fault]);
  return groups;
}

/** Faults in words: x servo, dead; sensor, noise. */
export const faultList = (ids: string[]) =>
  ids.map((id) => id.replace(":", ", ").replace("_", " ")).join("; ");
