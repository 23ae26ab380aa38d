/** The time by which the second recording begins later than the first. */
export function ShiftField({ shift, set }: { shift: number; set: (shift: number) => void }) {
  const change = (text: string) => {
    const next = Number(text);
    if (text.trim() && Number.isFinite(next)) set(next);
  };
  return (
    <label class="inline">
      Shift second session by{" "}
      <input type="number" step="0.1" value={shift} onInput={(e) => change(e.currentTarget.value)} /> s
    </label>
  );
}
