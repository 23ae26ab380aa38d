//! TLS, by rustls. Certificate and key are read again when their files change, so that a
//! renewed certificate needs no restart.

use std::path::Path;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, SystemTime};

use anyhow::{Context, Result};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::server::TlsStream;
use tokio_util::sync::CancellationToken;

use super::connections::LimitedConnection;
use crate::config::TlsConfig;

/// Interval at which the files are checked for changes.
const CHECK_INTERVAL: Duration = Duration::from_secs(60);

/// The certificate and the key in use. Clones share them.
#[derive(Clone)]
pub(super) struct Tls {
    files: TlsConfig,
    config: Arc<RwLock<Arc<ServerConfig>>>,
}

impl Tls {
    /// Reads the files.
    pub(super) fn read(files: &TlsConfig) -> Result<Self> {
        let config = Arc::new(RwLock::new(Arc::new(server_config(files)?)));
        Ok(Self { files: files.clone(), config })
    }

    /// Makes the TLS handshake of a connection, with the latest certificate.
    pub(super) async fn accept(
        &self,
        socket: LimitedConnection,
    ) -> std::io::Result<TlsStream<LimitedConnection>> {
        let config = self.config.read().unwrap_or_else(PoisonError::into_inner).clone();
        TlsAcceptor::from(config).accept(socket).await
    }

    /// Reads the files again whenever they change, until the server stops. If they are
    /// invalid, the error is logged and the previous certificate stays in use.
    pub(super) async fn watch(self, closing: CancellationToken) {
        let mut seen = self.changed_at();
        while closing.run_until_cancelled(tokio::time::sleep(CHECK_INTERVAL)).await.is_some() {
            let changed = self.changed_at();
            if changed != seen {
                seen = changed;
                self.reload();
            }
        }
    }

    fn reload(&self) {
        match server_config(&self.files) {
            Ok(config) => {
                let mut current = self.config.write().unwrap_or_else(PoisonError::into_inner);
                *current = Arc::new(config);
                tracing::info!("new TLS certificate in use");
            }
            Err(error) => tracing::error!("the previous TLS certificate stays in use: {error:#}"),
        }
    }

    fn changed_at(&self) -> [Option<SystemTime>; 2] {
        let changed = |path: &Path| std::fs::metadata(path).and_then(|file| file.modified()).ok();
        [changed(&self.files.certificate), changed(&self.files.key)]
    }
}

fn server_config(files: &TlsConfig) -> Result<ServerConfig> {
    let TlsConfig { certificate, key } = files;
    let chain = CertificateDer::pem_file_iter(certificate).and_then(Iterator::collect);
    let chain: Vec<_> = chain
        .with_context(|| format!("`tls.certificate`: cannot read {}", certificate.display()))?;
    let key = PrivateKeyDer::from_pem_file(key)
        .with_context(|| format!("`tls.key`: cannot read {}", files.key.display()))?;
    let mut config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()?
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .context("`tls`: the key does not match the certificate")?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(files: &TlsConfig, certified: &rcgen::CertifiedKey<rcgen::KeyPair>) {
        std::fs::write(&files.certificate, certified.cert.pem()).unwrap();
        std::fs::write(&files.key, certified.signing_key.serialize_pem()).unwrap();
    }

    #[test]
    fn an_error_names_the_file_and_the_previous_certificate_stays() {
        let directory = tempfile::tempdir().unwrap();
        let files = TlsConfig {
            certificate: directory.path().join("certificate.pem"),
            key: directory.path().join("key.pem"),
        };
        let missing = Tls::read(&files).err().unwrap().to_string();
        assert!(missing.contains("tls.certificate"), "{missing}");
        let pair = || rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        write(&files, &pair());
        let tls = Tls::read(&files).unwrap();
        let before = tls.config.read().unwrap().clone();
        std::fs::write(&files.key, pair().signing_key.serialize_pem()).unwrap();
        let wrong = Tls::read(&files).err().unwrap().to_string();
        assert!(wrong.contains("does not match"), "{wrong}");
        tls.reload();
        assert!(Arc::ptr_eq(&before, &tls.config.read().unwrap()));
        write(&files, &pair());
        tls.reload();
        assert!(!Arc::ptr_eq(&before, &tls.config.read().unwrap()));
    }
}
