import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Caller } from "../../api/types";

export const CallerContext = createContext<Caller | undefined>(undefined);

/** Who uses the page; a service without tokens lets everyone do everything. */
export const useCaller = () => useContext(CallerContext);
