import { useEffect, useState } from "preact/hooks";

/** Narrower windows are laid out for a phone, as in the style sheet, px. */
const PHONE_WIDTH = 700;

const height = () => (innerWidth < PHONE_WIDTH ? 104 : 56);

/** Rows are as high as this, px; on a phone they have two lines more. */
export function useRowHeight(): number {
  const [rowHeight, setRowHeight] = useState(height);
  useEffect(() => {
    const measure = () => setRowHeight(height());
    addEventListener("resize", measure);
    return () => removeEventListener("resize", measure);
  }, []);
  return rowHeight;
}
