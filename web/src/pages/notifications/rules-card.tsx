import { useState } from "preact/hooks";
import type { Channel, Rule } from "../../api/alarms";
import { Dialog } from "../../parts/dialog";
import { RuleForm } from "./rule-form";
import { RuleRow } from "./rule-row";

interface Props {
  rules: Rule[];
  /** None if the caller may not change them. */
  channels?: Channel[];
  refetch: () => Promise<unknown>;
}

export function RulesCard({ rules, channels, refetch }: Props) {
  const [isOpen, setOpen] = useState(false);
  const made = () => {
    setOpen(false);
    void refetch();
  };
  return (
    <section class="card">
      <h2>Rules</h2>
      {!rules.length && <p class="quiet">No rules yet: no notifications are sent.</p>}
      {rules.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Name</th>
                <th>Rigs</th>
                <th>Notifies of</th>
                <th>Channel</th>
                <th>Repeated</th>
                {channels && <th>Actions</th>}
              </tr>
            </thead>
            <tbody>
              {rules.map((rule) => (
                <RuleRow key={rule.id} rule={rule} channels={channels} refetch={refetch} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {channels && (
        <p>
          <button type="button" disabled={!channels.length} onClick={() => setOpen(true)}>
            Add a rule
          </button>
          {!channels.length && <span class="quiet"> Add a channel first.</span>}
        </p>
      )}
      {isOpen && channels && (
        <Dialog title="Add a rule" close={() => setOpen(false)}>
          <RuleForm channels={channels} saved={made} />
        </Dialog>
      )}
    </section>
  );
}
