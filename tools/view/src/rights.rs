//! The right to command, held by clients that know the token.

use std::collections::HashSet;
use std::sync::Mutex;

use foxglove::websocket::{ClientId, Parameter, ParameterValue};
use motorium::os::random_bytes;
use serde_json::json;

/// Parameter by which a client sends the token.
pub(crate) const TOKEN: &str = "motorium/token";

/// Clients with the right to command, and the token that grants it.
#[derive(Debug)]
pub(crate) struct Rights {
    token: String,
    holders: Mutex<HashSet<ClientId>>,
}

impl Rights {
    /// Creates rights that this token grants.
    pub(crate) fn new(token: String) -> Self {
        Self { token, holders: Mutex::default() }
    }

    /// Removes the token from parameters set by a client, and grants the right if the token is correct.
    /// Returns `false` if it is wrong.
    pub(crate) fn take_token(&self, client: ClientId, parameters: &mut Vec<Parameter>) -> bool {
        let mut right = true;
        parameters.retain(|parameter| {
            if parameter.name != TOKEN {
                return true;
            }
            match &parameter.value {
                Some(ParameterValue::String(given)) if is_token(&self.token, given) => {
                    self.holders().insert(client);
                }
                _ => right = false,
            }
            false
        });
        right
    }

    /// Returns `true` if a client may command.
    pub(crate) fn may_command(&self, client: ClientId) -> bool {
        self.holders().contains(&client)
    }

    fn holders(&self) -> std::sync::MutexGuard<'_, HashSet<ClientId>> {
        self.holders.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// Generates a random token.
pub(crate) fn new_token() -> std::io::Result<String> {
    Ok(random_bytes::<16>()?.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Compares tokens in constant time.
pub(crate) fn is_token(token: &str, given: &str) -> bool {
    let differences = token.bytes().zip(given.bytes()).fold(0, |all, (one, other)| all | (one ^ other));
    token.len() == given.len() && differences == 0
}

/// Returns the message with which a client sends the token.
pub(crate) fn grant(token: &str) -> String {
    json!({ "op": "setParameters", "parameters": [{ "name": TOKEN, "value": token }] }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_differ_and_only_the_full_one_is_accepted() {
        let token = new_token().unwrap();
        assert_ne!(token, new_token().unwrap());
        assert_eq!(token.len(), 32);
        assert!(is_token(&token, &token.clone()));
        for wrong in ["", &token[..31], &format!("{token}0"), "0123456789abcdef0123456789abcdeg"] {
            assert!(!is_token(&token, wrong), "{wrong}");
        }
    }
}
