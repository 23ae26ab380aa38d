//! The committed OpenAPI description equals the one generated from the code.

const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.yaml");

#[test]
fn openapi_yaml_equals_the_generated_description() {
    let generated = offbd::http::openapi_yaml();
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(COMMITTED, &generated).unwrap();
    }
    let committed = std::fs::read_to_string(COMMITTED).unwrap_or_default();
    assert!(
        committed == generated,
        "openapi.yaml is out of date; refresh it with\n    UPDATE_OPENAPI=1 cargo test --test it openapi\n"
    );
}
