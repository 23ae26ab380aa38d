//! The files of an import: the body, or those of a form (`multipart/form-data`).

use std::convert::Infallible;
use std::io::Cursor;
use std::sync::Arc;

use axum::body::Bytes;
use axum::http::HeaderMap;
use axum::http::header::CONTENT_TYPE;
use multer::Multipart;

use super::body::{BodyShare, BudgetedBody, ReservedBytes};
use super::{Problem, session_format};
use offbd_core::vocabulary::Invalid;
use offbd_service::ImportFile;
use offbd_wire::problem::MALFORMED;

/// Most files of one import. Chosen: a day in pieces of ten minutes. A form with more is refused.
const MAX_FILES: usize = 144;

/// The bytes of a file, and those of the budget that they take.
pub(super) struct FileBytes {
    bytes: Bytes,
    _reserved: Arc<ReservedBytes>,
}

impl AsRef<[u8]> for FileBytes {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

pub(super) type File = ImportFile<Cursor<FileBytes>>;

/// What the headers say of the body.
pub(super) enum BodyKind {
    File(Option<offbd_wire::session_file::SessionFormat>),
    Form { boundary: String },
}

impl BodyKind {
    /// Reads the headers.
    ///
    /// # Errors
    /// 415 if the body is neither a recording nor a form.
    pub(super) fn of(headers: &HeaderMap) -> Result<Self, Problem> {
        let text = headers.get(CONTENT_TYPE).and_then(|header| header.to_str().ok());
        match text.map(multer::parse_boundary) {
            Some(Ok(boundary)) => Ok(Self::Form { boundary }),
            _ => session_format::of_file(headers).map(Self::File),
        }
    }

    /// Returns the files in `body`, at least one.
    ///
    /// # Errors
    /// 400 if a form is malformed or has no file, 413 if it has too many, 429 if there is too little
    /// room for it.
    pub(super) async fn files(
        self,
        body: BudgetedBody,
        share: &BodyShare,
    ) -> Result<Vec<File>, Problem> {
        let (bytes, mut reserved) = body.into_parts();
        match self {
            Self::File(format) => {
                let reserved = Arc::new(reserved);
                let bytes = FileBytes { bytes: bytes.into(), _reserved: reserved };
                Ok(vec![ImportFile { name: String::new(), source: Cursor::new(bytes), format }])
            }
            Self::Form { boundary } => {
                // The form and its files are in memory at a time.
                reserved.add(bytes.len(), share)?;
                form_files(bytes, &boundary, &Arc::new(reserved)).await
            }
        }
    }
}

async fn form_files(
    bytes: Vec<u8>,
    boundary: &str,
    reserved: &Arc<ReservedBytes>,
) -> Result<Vec<File>, Problem> {
    let malformed =
        |error: multer::Error| Problem::new(MALFORMED, format!("the form is malformed: {error}"));
    let body = futures_util::stream::iter([Ok::<_, Infallible>(Bytes::from(bytes))]);
    let mut form = Multipart::new(body, boundary);
    let mut files = Vec::new();
    while let Some(field) = form.next_field().await.map_err(malformed)? {
        let field_name = field.name().unwrap_or_default().to_owned();
        let Some(name) = field.file_name().map(str::to_owned) else {
            let reason = format!("the field `{field_name}` of the form is not a file");
            return Err(Invalid::new("", reason).into());
        };
        if files.len() == MAX_FILES {
            let reason = format!("the form has more than {MAX_FILES} files");
            return Err(Invalid::new("", reason).into());
        }
        // Programs know few types of files; the first bytes say what a file is.
        let format = session_format::of_file(field.headers()).ok().flatten();
        let has_type = field.headers().contains_key(CONTENT_TYPE);
        let bytes = field.bytes().await.map_err(malformed)?;
        let source = Cursor::new(FileBytes { bytes, _reserved: reserved.clone() });
        files.push(ImportFile { name, source, format: format.filter(|_| has_type) });
    }
    if files.is_empty() {
        return Err(Invalid::new("", "the form has no file").into());
    }
    Ok(files)
}
