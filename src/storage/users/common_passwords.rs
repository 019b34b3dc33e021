//! Passwords that everybody tries first. Lists of leaked passwords hold next to nothing of fifteen characters; what people make of
//! that length without a thought is a common word with digits, a row of keys, or a repetition, and so that is looked for.

/// Words that passwords are made of, of the common lists and of this service.
const WORDS: &[&str] = &[
    "password",
    "passwort",
    "passphrase",
    "welcome",
    "willkommen",
    "letmein",
    "iloveyou",
    "admin",
    "administrator",
    "login",
    "secret",
    "changeme",
    "default",
    "qwerty",
    "qwertz",
    "azerty",
    "asdf",
    "yxcv",
    "zxcv",
    "abc",
    "monkey",
    "dragon",
    "football",
    "baseball",
    "sunshine",
    "princess",
    "master",
    "superman",
    "batman",
    "trustno",
    "whatever",
    "computer",
    "internet",
    "hello",
    "test",
    "user",
    "surefoot",
    "clinic",
    "klinik",
    "hospital",
    "doctor",
    "summer",
    "winter",
    "spring",
    "autumn",
    "letme",
];
/// Rows in which neighbours of a password lie.
const ROWS: [&str; 9] = [
    "abcdefghijklmnopqrstuvwxyz",
    "01234567890",
    "qwertyuiop",
    "qwertzuiop",
    "azertyuiop",
    "asdfghjkl",
    "zxcvbnm",
    "yxcvbnm",
    "qsdfghjklm",
];
/// Fewer different characters than this are a pattern.
const FEWEST_DIFFERENT: usize = 6;
/// Letters that must be left when common words are taken out.
const FEWEST_OWN_LETTERS: usize = 5;

/// True of a password that is a pattern, or consists of common words and of the user's own name.
pub(super) fn is_common(password: &str, user_name: &str) -> bool {
    let plain: Vec<char> = password.to_lowercase().chars().collect();
    has_few_characters(&plain) || is_repetition(&plain) || is_row(&plain) || is_of_common_words(&plain, user_name)
}

fn has_few_characters(password: &[char]) -> bool {
    let mut different = password.to_vec();
    different.sort_unstable();
    different.dedup();
    different.len() < FEWEST_DIFFERENT
}

/// Made of one piece, over and over, the last time perhaps not whole.
fn is_repetition(password: &[char]) -> bool {
    let n = password.len();
    (1..=n / 2).any(|period| (period..n).all(|i| password[i] == password[i - period]))
}

/// Three in four steps go to a neighbour in a row, in either direction.
fn is_row(password: &[char]) -> bool {
    let are_neighbours = |pair: &[char]| {
        ROWS.iter().any(|row| {
            let places = [pair[0], pair[1]].map(|letter| row.chars().position(|other| other == letter));
            matches!(places, [Some(a), Some(b)] if a.abs_diff(b) == 1)
        })
    };
    let steps = password.len().saturating_sub(1);
    let in_rows = password.windows(2).filter(|pair| are_neighbours(pair)).count();
    4 * in_rows >= 3 * steps
}

/// Hardly a letter is left without the common words, also where digits and signs stand for letters.
fn is_of_common_words(password: &[char], user_name: &str) -> bool {
    let meant: Vec<char> = password.iter().map(|letter| letter_meant(*letter)).collect();
    let mut is_common = vec![false; meant.len()];
    let pieces = user_name.split(['.', '_', '-']).filter(|piece| piece.len() >= 3);
    for word in WORDS.iter().copied().chain(pieces) {
        let word: Vec<char> = word.chars().map(letter_meant).collect();
        let found = meant.windows(word.len()).enumerate().filter(|(_, piece)| *piece == word);
        for (start, _) in found {
            is_common[start..start + word.len()].fill(true);
        }
    }
    let own = password.iter().zip(&is_common).filter(|(letter, is_common)| letter.is_alphabetic() && !**is_common);
    own.count() < FEWEST_OWN_LETTERS && !has_own_digits(password)
}

/// Eight digits that are neither a row nor a repetition are somebody's own.
fn has_own_digits(password: &[char]) -> bool {
    let digits: Vec<char> = password.iter().copied().filter(char::is_ascii_digit).collect();
    digits.len() >= 8 && !is_row(&digits) && !is_repetition(&digits) && !has_few_characters(&digits)
}

fn letter_meant(sign: char) -> char {
    match sign {
        '0' => 'o',
        '1' | '!' => 'i',
        '3' => 'e',
        '4' | '@' => 'a',
        '5' | '$' => 's',
        '7' => 't',
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_everybody_tries_first_is_common() {
        for common in [
            "passwordpassword",
            "Password12345678",
            "P@ssw0rd!P@ssw0rd!",
            "Welcome2026!!!!!",
            "123456789012345",
            "qwertyuiopasdfgh",
            "abcdefghijklmnop",
            "aaaaaaaaaaaaaaab",
            "surefoot-surefoot1",
            "surefootclinic2026",
            "dr.lee dr.lee dr.lee",
            "marguerite-lee-1",
        ] {
            assert!(is_common(common, "marguerite.lee"), "{common}");
        }
    }

    #[test]
    fn a_few_words_of_ones_own_are_not() {
        for own in [
            "correct horse battery",
            "a quiet garden path",
            "grüne Äpfel im Mai",
            "tvq7-92mx-ahr4-kk",
            "2718281828459045-x",
        ] {
            assert!(!is_common(own, "marguerite.lee"), "{own}");
        }
    }
}
