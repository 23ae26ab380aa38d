import { useEffect, useState } from "preact/hooks";

/** Width below which the layout is that of a phone, as in the style sheet, px. */
const PHONE_WIDTH = 700;

const height = () => (innerWidth < PHONE_WIDTH ? 104 : 56);

/** The height of a row, px; on a phone it has two more lines. */
export function useRowHeight(): number {
  const [rowHeight, setRowHeight] = useState(height);
  useEffect(() => {
    const measure = () => setRowHeight(height());
    addEventListener("resize", measure);
    return () => removeEventListener("resize", measure);
  }, []);
  return rowHeight;
}
