//! Passwords: which are good enough, and how they are kept.
//!
//! The rules are those of NIST SP 800-63B-4 (section 3.1.1.2) for a password that is the only factor: at least fifteen characters,
//! long ones allowed, no rules of composition, no change without a reason, and none that everybody tries first. Only the argon2id
//! digest is kept, with the parameters that OWASP's cheat sheet on password storage gives (19 MiB, two passes, one lane), which are
//! those of the crate.

use super::super::StorageError;
use super::common_passwords;
use argon2::Argon2;
use argon2::password_hash::phc::PasswordHash;
use argon2::password_hash::{PasswordHasher, PasswordVerifier};
use rand::TryRng;
use rand::rngs::SysRng;
use std::fmt;
use std::sync::OnceLock;
use unicode_normalization::UnicodeNormalization;

/// Shortest password, characters.
pub const SHORTEST: usize = 15;
/// Longest password, characters; NIST asks for 64 at least.
pub const LONGEST: usize = 128;

/// A password as somebody types it, in the normal form NFC, so that one password does not depend on the keyboard.
#[derive(Clone, PartialEq, Eq)]
pub struct Password(String);

impl Password {
    /// A password as a form brings it.
    pub fn from_text(text: &str) -> Self {
        Self(text.nfc().collect())
    }

    /// A password for the first sign-in: 100 random bits in groups that can be read aloud.
    pub(super) fn generate() -> Result<Self, StorageError> {
        /// Without letters that look or sound alike; 32 of them, so that every one carries five bits.
        const LETTERS: &[u8; 32] = b"abcdefghijkmnpqrstuvwxyz23456789";
        let mut bits = [0u8; 20];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| StorageError::Randomness(error.to_string()))?;
        let letters: Vec<char> = bits.iter().map(|byte| char::from(LETTERS[usize::from(byte % 32)])).collect();
        let groups: Vec<String> = letters.chunks(5).map(|group| group.iter().collect()).collect();
        Ok(Self(groups.join("-")))
    }

    /// The secret text, to be shown once.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// Why a user must not take this password, in a sentence; none for a good one.
    pub fn weakness(&self, user_name: &str) -> Option<String> {
        let length = self.0.chars().count();
        if !(SHORTEST..=LONGEST).contains(&length) {
            return Some(format!(
                "The password must have {SHORTEST} to {LONGEST} characters; several words are a good one."
            ));
        }
        if self.0.chars().any(char::is_control) {
            return Some("The password must not hold control characters.".to_owned());
        }
        common_passwords::is_common(&self.0, user_name).then(|| {
            "The password is among those that are tried first: a common word, a row of keys, or a repetition. Choose another."
                .to_owned()
        })
    }

    /// The digest that is kept; slow on purpose, so it belongs on a blocking thread.
    pub(super) fn digest(&self) -> Result<String, StorageError> {
        let hash: PasswordHash = Argon2::default()
            .hash_password(self.0.as_bytes())
            .map_err(|error| StorageError::Randomness(error.to_string()))?;
        Ok(hash.to_string())
    }

    /// True when the kept digest is that of this password. Without a digest it is compared with one that is nobody's, so that the
    /// answer takes the same time and says nothing of who there is.
    pub(super) fn matches(&self, digest: Option<&str>) -> bool {
        static NOBODYS: OnceLock<String> = OnceLock::new();
        // Made at the first comparison, whoever it is about, so that the first unknown name does not take longer.
        let nobodys = NOBODYS.get_or_init(|| Password("nobody signs in with this".into()).digest().unwrap_or_default());
        let is_somebodys = digest.is_some();
        let Ok(kept) = PasswordHash::new(digest.unwrap_or(nobodys)) else { return false };
        let is_same = Argon2::default().verify_password(self.0.as_bytes(), &kept).is_ok();
        is_same && is_somebodys
    }
}

impl fmt::Debug for Password {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Password(…)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_is_argon2id_and_fits_its_password_only() {
        let password = Password::from_text("a quiet garden path");
        let digest = password.digest().unwrap();
        assert!(digest.starts_with("$argon2id$v=19$m=19456,t=2,p=1$"), "{digest}");
        assert!(password.matches(Some(&digest)));
        assert!(!Password::from_text("a quiet garden wall").matches(Some(&digest)));
        assert!(!password.matches(None) && !password.matches(Some("no digest")));
        assert_ne!(password.digest().unwrap(), digest, "each has its own salt");
        assert!(!Password::from_text("nobody signs in with this").matches(None));
    }

    #[test]
    fn length_is_counted_in_characters_and_one_password_has_one_form() {
        assert!(Password::from_text("fourteen chars").weakness("lee").is_some());
        assert_eq!(Password::from_text("fifteen-letters").weakness("lee"), None);
        assert_eq!(Password::from_text("größer über äpfeln").weakness("lee"), None);
        assert!(Password::from_text(&"wxyz ".repeat(26)).weakness("lee").is_some());
        assert_eq!(Password::from_text("u\u{308}bermorgen fru\u{308}h"), Password::from_text("übermorgen früh"));
    }

    #[test]
    fn a_generated_password_is_a_good_one_and_another_each_time() {
        let [one, other] = [(); 2].map(|()| Password::generate().unwrap());
        assert_eq!((one.weakness("lee"), one.reveal().len()), (None, 23));
        assert_ne!(one, other);
        assert!(!format!("{one:?}").contains(one.reveal()));
    }
}
