import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { ServiceHealth } from "../api/types";

export const HealthContext = createContext<ServiceHealth | undefined>(undefined);

/** Whether the running build of the service has an optional part; true until it is known, and of an older service. */
export function useFeature(): (name: string | undefined) => boolean {
  const features = useContext(HealthContext)?.features;
  return (name) => !name || !features || features.includes(name);
}
