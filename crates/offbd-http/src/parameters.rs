//! The check of query parameters, for every operation, by its own description.
//!
//! A parameter that the description does not name is refused: a misspelt filter would
//! otherwise answer with everything. So is one that is given twice, or a value of another type
//! or beyond the range that the description states. Words of closed sets are checked by the
//! handlers, which know them.

use std::sync::Arc;

use utoipa::Number;
use utoipa::openapi::path::{Operation, Parameter, ParameterIn, ParameterStyle};
use utoipa::openapi::schema::{Schema, SchemaType, Type};
use utoipa::openapi::{Object, RefOr};

use offbd_core::vocabulary::Invalid;

/// The query parameters of one operation.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ParameterRules(Arc<[ParameterRule]>);

#[derive(Clone, Debug, PartialEq)]
struct ParameterRule {
    name: String,
    value: ValueRule,
}

/// The permitted values of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ValueRule {
    Text,
    Boolean,
    Integer {
        first: f64,
        last: f64,
    },
    Number {
        first: f64,
        last: f64,
    },
    /// Any number of `name[key]=value` and `name=value`, which the handler checks.
    Keyed,
}

impl ParameterRules {
    /// Collects the rules in the description of an operation.
    pub(super) fn of(operation: &Operation) -> Self {
        let parameters = operation.parameters.iter().flatten();
        let rules = parameters.filter_map(|parameter| match parameter {
            RefOr::T(p) if p.parameter_in == ParameterIn::Query => {
                Some(ParameterRule { name: p.name.clone(), value: value(p) })
            }
            _ => None,
        });
        Self(rules.collect())
    }

    /// Checks the query of a URI.
    ///
    /// # Errors
    /// [`Invalid`] with the parameter as `?name`.
    pub(super) fn check(&self, query: Option<&str>) -> Result<(), Invalid> {
        let mut seen: Vec<&str> = Vec::new();
        for (name, value) in form_urlencoded::parse(query.unwrap_or_default().as_bytes()) {
            let Some(rule) = self.0.iter().find(|rule| rule.takes(&name)) else {
                return Err(self.unknown(&name));
            };
            if rule.value == ValueRule::Keyed {
                continue;
            }
            if seen.contains(&rule.name.as_str()) {
                return Err(Invalid::new(format!("?{name}"), "is given more than once"));
            }
            seen.push(&rule.name);
            rule.value.check(&value).map_err(|reason| Invalid::new(format!("?{name}"), reason))?;
        }
        Ok(())
    }

    fn unknown(&self, name: &str) -> Invalid {
        let names: Vec<&str> = self.0.iter().map(|rule| rule.name.as_str()).collect();
        let known = match names.as_slice() {
            [] => "it has no query parameters".to_owned(),
            names => format!("it has {}", names.join(", ")),
        };
        let shown: String = name.chars().take(MAX_SHOWN).collect();
        Invalid::new(format!("?{shown}"), format!("is not a parameter of this operation; {known}"))
    }
}

/// Longest name and value in an answer, characters; a longer one is cut.
const MAX_SHOWN: usize = 60;

impl ParameterRule {
    fn takes(&self, name: &str) -> bool {
        let key = || name.strip_prefix(&*self.name)?.strip_prefix('[')?.strip_suffix(']');
        self.name == name || (self.value == ValueRule::Keyed && key().is_some())
    }
}

impl ValueRule {
    fn check(self, text: &str) -> Result<(), String> {
        let fits = match self {
            Self::Text | Self::Keyed => true,
            Self::Boolean => matches!(text, "true" | "false"),
            Self::Integer { first, last } => text.parse::<i64>().is_ok_and(|n| {
                let n = n as f64;
                (first..=last).contains(&n)
            }),
            Self::Number { first, last } => {
                text.parse::<f64>().is_ok_and(|n| n.is_finite() && (first..=last).contains(&n))
            }
        };
        if fits {
            return Ok(());
        }
        let shown: String = text.chars().take(MAX_SHOWN).collect();
        Err(format!("`{shown}` is not {}", self.words()))
    }

    fn words(self) -> String {
        let (kind, first, last) = match self {
            Self::Boolean => return "true or false".to_owned(),
            Self::Text | Self::Keyed => return "text".to_owned(),
            Self::Integer { first, last } => ("a whole number", first, last),
            Self::Number { first, last } => ("a number", first, last),
        };
        match (first.is_finite(), last.is_finite()) {
            (true, true) => format!("{kind} from {first} to {last}"),
            (true, false) => format!("{kind} from {first}"),
            (false, true) => format!("{kind} up to {last}"),
            (false, false) => kind.to_owned(),
        }
    }
}

fn value(parameter: &Parameter) -> ValueRule {
    if parameter.style == Some(ParameterStyle::DeepObject) {
        return ValueRule::Keyed;
    }
    let Some(RefOr::T(Schema::Object(object))) = &parameter.schema else { return ValueRule::Text };
    let (first, last) = range(object);
    match &object.schema_type {
        SchemaType::Type(kind) => of_type(kind, first, last),
        SchemaType::Array(kinds) => {
            let kind = kinds.iter().find(|kind| **kind != Type::Null);
            kind.map_or(ValueRule::Text, |kind| of_type(kind, first, last))
        }
        SchemaType::AnyValue => ValueRule::Text,
    }
}

fn of_type(kind: &Type, first: f64, last: f64) -> ValueRule {
    match kind {
        Type::Integer => ValueRule::Integer { first, last },
        Type::Number => ValueRule::Number { first, last },
        Type::Boolean => ValueRule::Boolean,
        _ => ValueRule::Text,
    }
}

/// Returns the range that a schema states; the handlers check an exclusive limit.
fn range(object: &Object) -> (f64, f64) {
    let number = |limit: &Option<Number>| limit.as_ref().map(as_f64);
    let first = number(&object.minimum).unwrap_or(f64::NEG_INFINITY);
    (first, number(&object.maximum).unwrap_or(f64::INFINITY))
}

/// Limits in descriptions are smaller than 2^53, so that they are exact.
fn as_f64(limit: &Number) -> f64 {
    match limit {
        Number::Int(limit) => *limit as f64,
        Number::UInt(limit) => *limit as f64,
        Number::Float(limit) => *limit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::openapi;

    fn rules(path: &str) -> ParameterRules {
        let document = openapi();
        ParameterRules::of(document.paths.paths[path].get.as_ref().unwrap())
    }

    #[test]
    fn a_query_is_checked_by_the_description_of_its_operation() {
        let sessions = rules("/api/v1/sessions");
        sessions.check(None).unwrap();
        sessions.check(Some("asset=a%20b&limit=500")).unwrap();
        for (query, element, reason) in [
            ("asett=b", "?asett", "is not a parameter of this operation; it has asset"),
            ("limit=0", "?limit", "`0` is not a whole number from 1 to 500"),
            ("limit=-1", "?limit", "`-1` is not a whole number from 1 to 500"),
            ("limit=501", "?limit", "`501` is not a whole number from 1 to 500"),
            ("limit=9e9", "?limit", "`9e9` is not"),
            ("limit=", "?limit", "`` is not"),
            ("asset=a&asset=b", "?asset", "is given more than once"),
            ("as%73et=a&asset=b", "?asset", "is given more than once"),
        ] {
            let found = sessions.check(Some(query)).unwrap_err();
            assert_eq!(found.element, element, "{query}");
            assert!(found.reason.starts_with(reason), "{query}: {}", found.reason);
        }
        let none = rules("/api/v1/sessions/{id}").check(Some("x=1")).unwrap_err();
        assert!(none.reason.ends_with("it has no query parameters"), "{none}");
        let telemetry = rules("/api/v1/sessions/{id}/telemetry");
        for text in ["nan", "inf", "1,5", "0x1"] {
            telemetry.check(Some(&format!("from_s={text}"))).unwrap_err();
        }
        telemetry.check(Some("from_s=-1.5e3&to_s=2")).unwrap();
    }
}
