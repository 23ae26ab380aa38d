import { isNeutralBit, STATUS_BITS } from "../../words/status-byte";

/** The bits of the status byte. */
export function StatusByte({ byte }: { byte: string }) {
  const bits = Number.parseInt(byte, 16);
  return (
    <section class="card">
      <h2>
        Status byte <code>{byte}</code>
      </h2>
      <table class="bits">
        <thead class="hidden">
          <tr>
            <th>Bit</th>
            <th>Value</th>
            <th>Meaning</th>
          </tr>
        </thead>
        <tbody>
          {STATUS_BITS.map(({ bit, name, on, off }) => {
            const isSet = ((bits >> bit) & 1) === 1;
            return (
              <tr class={`${isSet ? "set" : ""}${isNeutralBit(bit) ? " neutral" : ""}`}>
                <th scope="row">{bit}</th>
                <td class="bit">{isSet ? "1" : "0"}</td>
                <td>
                  <b>{name}</b>
                  <br />
                  {isSet ? on : off}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
      <p class="quiet small-text">ISO 14229-1, annex D.2. An operation cycle is a session.</p>
    </section>
  );
}
