//! Decides which events a rule sends.

use serde_json::Value;
use wildmatch::WildMatch;

use super::quiet_hours::QuietHours;
use crate::clock::parse_timestamp;
use offbd_core::diagnosis::StatusByte;
use offbd_store::{Micros, TagsByAsset};
use offbd_wire::notification::NewRuleView;
use offbd_wire::words::{AlarmChangeWord, AlarmCodeWord, KindWord, StatusWord};

/// A rule that is in the store.
#[derive(Clone, Debug)]
pub(super) struct ActiveRule {
    pub(super) id: String,
    pub(super) rule: NewRuleView,
    silent_until: Option<Micros>,
    quiet_hours: Option<QuietHours>,
    pattern: WildMatch,
}

/// What an event says about a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AlarmEvent {
    pub(super) code: AlarmCodeWord,
    pub(super) kind: Option<KindWord>,
    pub(super) change: AlarmChangeWord,
}

impl ActiveRule {
    pub(super) fn new(id: String, rule: NewRuleView) -> Self {
        let silent_until = rule.silent_until.as_deref().and_then(|t| parse_timestamp(t).ok());
        let pattern = WildMatch::new(&rule.asset);
        let quiet_hours = rule.quiet_hours.as_ref().and_then(|view| QuietHours::new(view).ok());
        Self { id, rule, silent_until, quiet_hours, pattern }
    }

    /// Returns whether the rule is for `code` of `asset`, whose tags are among `tags`.
    pub(super) fn concerns(&self, asset: &str, code: AlarmCodeWord, tags: &TagsByAsset) -> bool {
        let codes = &self.rule.codes;
        self.rule.enabled
            && self.pattern.matches(asset)
            && self.takes_tags(tags.get(asset).map_or(&[], Vec::as_slice))
            && (codes.is_empty() || codes.contains(&code))
    }

    fn takes_tags(&self, tags: &[String]) -> bool {
        self.rule.tag.as_ref().is_none_or(|wanted| tags.contains(wanted))
    }

    /// Returns whether the rule tells of such a change.
    pub(super) fn tells(&self, change: AlarmChangeWord) -> bool {
        self.rule.changes.contains(&change)
    }

    /// Returns the end of the silence, if there is one at `now`.
    pub(super) fn silence(&self, now: Micros) -> Option<Micros> {
        self.silent_until.filter(|until| *until > now).max(self.quiet_end(now))
    }

    /// Returns the end of the quiet hours, if `now` is within them.
    fn quiet_end(&self, now: Micros) -> Option<Micros> {
        self.quiet_hours.as_ref().and_then(|hours| hours.end(now))
    }

    /// Returns when the first message of a fault that an event of the time `at` tells is due; `None`
    /// for at once.
    pub(super) fn first_due(&self, at: Micros, now: Micros) -> Option<Micros> {
        let delay = self.rule.delay_s.map(|s| at + Micros::from(s) * 1_000_000);
        delay.or_else(|| self.quiet_end(now))
    }

    /// Whether first messages may wait.
    pub(super) const fn may_wait(&self) -> bool {
        self.rule.delay_s.is_some() || self.quiet_hours.is_some()
    }

    /// The interval of reminders, µs.
    pub(super) fn repeat(&self) -> Option<Micros> {
        self.rule.repeat_s.map(|s| Micros::from(s) * 1_000_000)
    }
}

impl AlarmEvent {
    /// Reads an event. Returns `None` for one that this version does not know.
    pub(super) fn of(document: &Value) -> Option<Self> {
        let word = |key: &str| document.get(key).and_then(Value::as_str);
        let code = word("code")?.parse().ok()?;
        let kind = word("kind").and_then(|kind| kind.parse().ok());
        if code == AlarmCodeWord::CommunicationLost {
            return Some(Self { code, kind, change: word("status")?.parse().ok()? });
        }
        let byte = u8::from_str_radix(word("status_byte")?, 16).ok()?;
        let fails = StatusByte::from_bits(byte).test_failed();
        let change = match (word("status")?.parse().ok()?, fails) {
            (StatusWord::Cleared, _) => AlarmChangeWord::Cleared,
            (StatusWord::Healed, _) => AlarmChangeWord::Healed,
            (StatusWord::Pending, true) => AlarmChangeWord::Pending,
            (StatusWord::Confirmed, true) => AlarmChangeWord::Confirmed,
            (StatusWord::Pending | StatusWord::Confirmed, false) => AlarmChangeWord::Passed,
        };
        Some(Self { code, kind, change })
    }

    /// Whether the test fails after it.
    pub(super) const fn fails(&self) -> bool {
        matches!(self.change, AlarmChangeWord::Pending | AlarmChangeWord::Confirmed)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use serde_json::json;

    fn rule(document: Value) -> ActiveRule {
        let mut whole = json!({ "name": "r", "channel": "c" });
        whole.as_object_mut().unwrap().extend(document.as_object().unwrap().clone());
        ActiveRule::new("r".into(), serde_json::from_value(whole).unwrap())
    }

    #[test]
    fn a_rule_is_for_the_assets_and_codes_that_it_names() {
        let none = TagsByAsset::new();
        let rule = rule(json!({ "asset": "lab?-*", "codes": ["sensor"] }));
        assert!(rule.concerns("lab1-03", AlarmCodeWord::Sensor, &none));
        assert!(!rule.concerns("lab1-03", AlarmCodeWord::XServo, &none));
        assert!(!rule.concerns("lab-03", AlarmCodeWord::Sensor, &none));
        assert!(!self::rule(json!({ "enabled": false })).concerns(
            "a",
            AlarmCodeWord::Sensor,
            &none
        ));
        assert!(self::rule(json!({})).concerns("a", AlarmCodeWord::CommunicationLost, &none));
    }

    #[test]
    fn a_rule_with_a_tag_is_for_the_assets_that_have_it() {
        let rule = rule(json!({ "tag": "hall-2" }));
        let tags = BTreeMap::from([
            ("a".to_owned(), vec!["hall-1".to_owned(), "hall-2".to_owned()]),
            ("b".to_owned(), vec!["hall-20".to_owned()]),
        ]);
        let concerns = |asset| rule.concerns(asset, AlarmCodeWord::Sensor, &tags);
        assert_eq!([concerns("a"), concerns("b"), concerns("c")], [true, false, false]);
    }

    #[test]
    fn a_silence_ends_by_itself() {
        let rule = rule(json!({ "silent_until": "1970-01-01T00:00:01Z" }));
        assert_eq!(rule.silence(999_999), Some(1_000_000));
        assert_eq!(rule.silence(1_000_000), None);
    }

    #[test]
    fn a_test_that_passes_again_is_not_a_confirmation() {
        let change = |status: &str, byte: &str| {
            let event = json!({ "code": "x_servo", "status": status, "status_byte": byte });
            AlarmEvent::of(&event).unwrap().change
        };
        assert_eq!(change("confirmed", "2F"), AlarmChangeWord::Confirmed);
        assert_eq!(change("confirmed", "2E"), AlarmChangeWord::Passed);
        assert_eq!(change("pending", "27"), AlarmChangeWord::Pending);
        assert_eq!(change("healed", "20"), AlarmChangeWord::Healed);
        assert_eq!(change("cleared", "50"), AlarmChangeWord::Cleared);
        let lost = json!({ "code": "communication_lost", "status": "passed" });
        assert_eq!(AlarmEvent::of(&lost).unwrap().change, AlarmChangeWord::Passed);
        assert_eq!(AlarmEvent::of(&json!({ "code": "new_code" })), None);
    }
}
