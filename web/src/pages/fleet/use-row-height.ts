import { useEffect, useState } from "preact/hooks";

/** Width below which a row has several lines, as in the style sheet, px. */
const NARROW_WIDTH = 960;

const height = () => (innerWidth < NARROW_WIDTH ? 104 : 56);

/** The height of a row, px; on a narrow screen it has two more lines. */
export function useRowHeight(): number {
  const [rowHeight, setRowHeight] = useState(height);
  useEffect(() => {
    const measure = () => setRowHeight(height());
    addEventListener("resize", measure);
    return () => removeEventListener("resize", measure);
  }, []);
  return rowHeight;
}
