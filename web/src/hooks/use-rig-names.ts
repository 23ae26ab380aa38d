import { api } from "../api/client";
import { useQuery } from "./use-query";

const NONE: string[] = [];

/** Reads the names of all rigs. */
export const fetchRigNames = () => api.fleet().then((fleet) => fleet.map((entry) => entry.asset));

/** The names of all rigs; none until they are known. */
export const useRigNames = (): string[] => useQuery(fetchRigNames, "names").data ?? NONE;
