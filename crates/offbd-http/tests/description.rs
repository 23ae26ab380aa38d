//! The committed descriptions of the interface, OpenAPI and AsyncAPI, equal those generated
//! from the code.

use std::path::Path;

#[test]
fn openapi_yaml_equals_the_generated_description() {
    compare("openapi.yaml", &offbd_http::openapi_yaml());
}

#[test]
fn asyncapi_yaml_equals_the_generated_description() {
    compare("asyncapi.yaml", &offbd_http::asyncapi_yaml());
}

fn compare(file: &str, generated: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file);
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(&path, generated).expect("the description is writable");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == generated,
        "{file} is out of date; refresh it with\n    UPDATE_OPENAPI=1 cargo test --package offbd-http --test description\n"
    );
}
