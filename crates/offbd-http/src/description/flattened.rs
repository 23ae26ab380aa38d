//! Objects with the fields of another one among their own.
//!
//! Such an object is described by `allOf`: the other one, and the fields that it adds. If the
//! other one permits no further fields, no object satisfies both: the result is described as one
//! object instead.

use std::collections::BTreeMap;

use utoipa::openapi::schema::{AdditionalProperties, AllOf, Object, Schema};
use utoipa::openapi::{ObjectBuilder, RefOr};

use super::SCHEMAS;

type Schemas = BTreeMap<String, RefOr<Schema>>;

/// Replaces every `allOf` with a closed part by one object that permits further fields.
pub(super) fn join_closed(schemas: &mut Schemas) {
    let joined = schemas.iter().filter_map(|(name, schema)| {
        let RefOr::T(Schema::AllOf(all)) = schema else { return None };
        Some((name.clone(), joined(all, schemas)?.into()))
    });
    let joined: Vec<_> = joined.collect();
    schemas.extend(joined);
}

/// Returns the parts of `all` as one object; `None` if each permits the fields of the others.
fn joined(all: &AllOf, schemas: &Schemas) -> Option<Schema> {
    let parts: Vec<&Object> =
        all.items.iter().map(|part| object(part, schemas)).collect::<Option<_>>()?;
    if !parts.iter().any(|part| is_closed(part)) {
        return None;
    }
    let mut whole = ObjectBuilder::new().description(all.description.clone()).build();
    for part in parts {
        whole.required.extend(part.required.iter().cloned());
        whole.properties.extend(part.properties.clone());
    }
    Some(whole.into())
}

/// Returns the object that `schema` is or refers to.
fn object<'a>(schema: &'a RefOr<Schema>, schemas: &'a Schemas) -> Option<&'a Object> {
    match schema {
        RefOr::T(Schema::Object(object)) => Some(object),
        RefOr::T(_) => None,
        RefOr::Ref(reference) => {
            let name = reference.ref_location.strip_prefix(SCHEMAS)?;
            object(schemas.get(name)?, schemas)
        }
    }
}

fn is_closed(object: &Object) -> bool {
    matches!(object.additional_properties.as_deref(), Some(AdditionalProperties::FreeForm(false)))
}
