//! Converts SVG to PNG with an embedded font, so that the result does not depend on the
//! fonts of the machine.

use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use super::error::ChartError;

/// Returns the drawing as PNG, with one pixel per pixel of the SVG.
///
/// # Errors
/// [`ChartError::Raster`] if `svg` is invalid.
pub fn png(svg: &str) -> Result<Vec<u8>, ChartError> {
    let failed = |reason: &dyn std::fmt::Display| ChartError::Raster(reason.to_string());
    let tree = Tree::from_str(svg, &options()).map_err(|e| failed(&e))?;
    let size = tree.size().to_int_size();
    let pixmap = Pixmap::new(size.width(), size.height());
    let mut pixmap = pixmap.ok_or_else(|| failed(&"no pixels"))?;
    resvg::render(&tree, Transform::default(), &mut pixmap.as_mut());
    pixmap.encode_png().map_err(|e| failed(&e))
}

/// Returns options that use the embedded DejaVu Sans for all text.
fn options() -> Options<'static> {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_source(fontdb::Source::Binary(Arc::new(dejavu::sans::regular())));
    fonts.set_sans_serif_family("DejaVu Sans");
    Options { fontdb: Arc::new(fonts), ..Options::default() }
}
