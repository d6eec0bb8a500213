//! TLS 1.3 between macro and agents with keys that both derive from the shared secret.
//!
//! Each role has a signing key of its own (Ed25519, its seed derived from the secret by PBKDF2 and HKDF-SHA256), shown as a raw public
//! key [RFC 7250] instead of a certificate: nothing expires, nothing has to be distributed but the secret. Either side accepts exactly the
//! key of the other role and no other, so a stranger fails in the handshake. The session keys are ephemeral: a secret that becomes
//! known later does not open connections that were recorded before.
//!
//! A stranger still sees the macro's public key, and may try guesses of the secret against it without any further connection. PBKDF2
//! makes each of them expensive.

use crate::lock;
use crate::secret::Secret;
use ring::{hkdf, pbkdf2};
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::{AlwaysResolvesClientRawPublicKeys, Resumption};
use rustls::crypto::{CryptoProvider, WebPkiSupportedAlgorithms, verify_tls13_signature_with_raw_key};
use rustls::pki_types::{CertificateDer, PrivatePkcs8KeyDer, ServerName, SubjectPublicKeyInfoDer, UnixTime};
use rustls::server::danger::{ClientCertVerified, ClientCertVerifier};
use rustls::server::{AlwaysResolvesServerRawPublicKeys, NoServerSessionStorage};
use rustls::sign::CertifiedKey;
use rustls::{
    CertificateError, ClientConfig, DigitallySignedStruct, DistinguishedName, Error, ServerConfig, SignatureScheme,
};
use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::sync::{Arc, Mutex};

/// Names the purpose in the derivation of keys: another use of the same secret gives other keys.
const SALT: &[u8] = b"grainspan hosts 2";

/// Rounds of PBKDF2: some 0.1 s, once per process.
const ROUNDS: NonZeroU32 = NonZeroU32::new(200_000).unwrap();

/// An Ed25519 key of 32 bytes in PKCS#8 [RFC 8410] is this and the seed.
const PKCS8_HEAD: [u8; 16] =
    [0x30, 0x2e, 0x02, 0x01, 0x00, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20];

/// Which side a key is for.
#[derive(Clone, Copy, Debug)]
enum Role {
    Macro,
    Agent,
}

impl Role {
    fn info(self) -> &'static [u8] {
        match self {
            Self::Macro => b"macro",
            Self::Agent => b"agent",
        }
    }
}

/// What the macro's listener shows and accepts.
///
/// # Errors
/// The key cannot be used; does not happen with keys made here.
pub(crate) fn macro_side(secret: &Secret) -> Result<Arc<ServerConfig>, Error> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let (own, peer) = (key(secret, Role::Macro, &provider)?, key(secret, Role::Agent, &provider)?);
    let mut config = ServerConfig::builder_with_provider(Arc::clone(&provider))
        .with_protocol_versions(&[&rustls::version::TLS13])?
        .with_client_cert_verifier(Arc::new(OnlyThisKey::new(&peer, &provider)?))
        .with_cert_resolver(Arc::new(AlwaysResolvesServerRawPublicKeys::new(Arc::new(own))));
    config.session_storage = Arc::new(NoServerSessionStorage {});
    config.send_tls13_tickets = 0;
    Ok(Arc::new(config))
}

/// What an agent shows and accepts.
///
/// # Errors
/// As [`macro_side`].
pub(crate) fn agent_side(secret: &Secret) -> Result<Arc<ClientConfig>, Error> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let (own, peer) = (key(secret, Role::Agent, &provider)?, key(secret, Role::Macro, &provider)?);
    let mut config = ClientConfig::builder_with_provider(Arc::clone(&provider))
        .with_protocol_versions(&[&rustls::version::TLS13])?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(OnlyThisKey::new(&peer, &provider)?))
        .with_client_cert_resolver(Arc::new(AlwaysResolvesClientRawPublicKeys::new(Arc::new(own))));
    config.resumption = Resumption::disabled();
    config.enable_sni = false;
    Ok(Arc::new(config))
}

/// The secret after PBKDF2; kept, since an agent joins many times.
fn stretched(secret: &Secret) -> [u8; 32] {
    static KNOWN: Mutex<BTreeMap<Vec<u8>, [u8; 32]>> = Mutex::new(BTreeMap::new());
    *lock(&KNOWN).entry(secret.bytes().to_vec()).or_insert_with(|| {
        let mut key = [0; 32];
        pbkdf2::derive(pbkdf2::PBKDF2_HMAC_SHA256, ROUNDS, SALT, secret.bytes(), &mut key);
        key
    })
}

/// The signing key of a role with its public half.
fn key(secret: &Secret, role: Role, provider: &CryptoProvider) -> Result<CertifiedKey, Error> {
    let unusable = |_| Error::General("no key could be derived from the secret".to_owned());
    let mut pkcs8 = [0u8; PKCS8_HEAD.len() + 32];
    pkcs8[..PKCS8_HEAD.len()].copy_from_slice(&PKCS8_HEAD);
    let extracted = hkdf::Salt::new(hkdf::HKDF_SHA256, SALT).extract(&stretched(secret));
    let info = [role.info()];
    let expanded = extracted.expand(&info, hkdf::HKDF_SHA256).map_err(unusable)?;
    expanded.fill(&mut pkcs8[PKCS8_HEAD.len()..]).map_err(unusable)?;
    let signing = provider.key_provider.load_private_key(PrivatePkcs8KeyDer::from(pkcs8.to_vec()).into())?;
    let public = signing.public_key().ok_or_else(|| Error::General("a key without its public half".to_owned()))?;
    let shown = vec![CertificateDer::from(public.as_ref().to_vec())];
    Ok(CertifiedKey::new(shown, signing))
}

/// Accepts one public key.
#[derive(Debug)]
struct OnlyThisKey {
    key: SubjectPublicKeyInfoDer<'static>,
    algorithms: WebPkiSupportedAlgorithms,
}

impl OnlyThisKey {
    fn new(peer: &CertifiedKey, provider: &CryptoProvider) -> Result<Self, Error> {
        let shown = peer.cert.first().ok_or(Error::NoCertificatesPresented)?;
        Ok(Self {
            key: SubjectPublicKeyInfoDer::from(shown.as_ref().to_vec()),
            algorithms: provider.signature_verification_algorithms,
        })
    }

    /// Whether it is the one.
    fn check(&self, shown: &CertificateDer<'_>) -> Result<(), Error> {
        // Public keys are no secrets: comparing them in varying time tells nothing.
        if shown.as_ref() == self.key.as_ref() {
            Ok(())
        } else {
            Err(Error::InvalidCertificate(CertificateError::ApplicationVerificationFailure))
        }
    }

    fn check_signature(
        &self,
        message: &[u8],
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature_with_raw_key(message, &self.key, signed, &self.algorithms)
    }
}

/// TLS 1.2 is switched off.
fn too_old() -> Error {
    Error::General("TLS 1.3 is required".to_owned())
}

impl ServerCertVerifier for OnlyThisKey {
    fn verify_server_cert(
        &self,
        shown: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        self.check(shown).map(|()| ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(too_old())
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        _: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        self.check_signature(message, signed)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        vec![SignatureScheme::ED25519]
    }

    fn requires_raw_public_keys(&self) -> bool {
        true
    }
}

impl ClientCertVerifier for OnlyThisKey {
    fn root_hint_subjects(&self) -> &[DistinguishedName] {
        &[]
    }

    fn verify_client_cert(
        &self,
        shown: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: UnixTime,
    ) -> Result<ClientCertVerified, Error> {
        self.check(shown).map(|()| ClientCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(too_old())
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        _: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        self.check_signature(message, signed)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        vec![SignatureScheme::ED25519]
    }

    fn requires_raw_public_keys(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_guess_of_the_secret_costs_as_many_rounds_as_are_promised() {
        let secret = Secret::from_text("0123456789abcdef", Path::new("-")).unwrap();
        // Python's hashlib.pbkdf2_hmac("sha256", secret, SALT, 200_000, 32).
        let expected = [0xda, 0x30, 0x07, 0x13, 0x76, 0x3e, 0x29, 0xa0];
        assert_eq!(stretched(&secret)[..8], expected);
        assert_eq!(stretched(&secret)[..8], expected, "the one that was kept");
    }
}
