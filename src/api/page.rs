//! Pages of a list: keyset pagination, newest first.
//!
//! Ids sort by time, so the id of the last item of a page is the place where the next one begins. Rows that arrive
//! meanwhile neither repeat nor hide anything.

use super::error::ApiError;
use base64::Engine;
use base64::alphabet::URL_SAFE;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// Items of a page when the request does not say.
pub const DEFAULT_LIMIT: u32 = 50;
/// Most items of one page.
pub const MAX_LIMIT: u32 = 200;

const CURSOR: GeneralPurpose = GeneralPurpose::new(
    &URL_SAFE,
    GeneralPurposeConfig::new()
        .with_encode_padding(false)
        .with_decode_padding_mode(DecodePaddingMode::RequireNone)
        .with_decode_allow_trailing_bits(true),
);

/// One page of a list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Page<T> {
    /// The items, newest first.
    pub items: Vec<T>,
    /// Address of the next page with the same filters; null on the last page.
    pub next: Option<String>,
}

impl<T> Page<T> {
    /// The page that the storage found, with the address of the next one.
    pub fn from_stored<R, Id>(
        stored: crate::storage::Page<R, Id>,
        link: &PageLink,
        id: impl FnOnce(Id) -> Uuid,
        item: impl FnMut(R) -> T,
    ) -> Self {
        let next = stored.next.map(|last| link.after(id(last)));
        Self { items: stored.items.into_iter().map(item).collect(), next }
    }
}

/// Writes the address of the next page.
#[derive(Debug, Clone)]
pub struct PageLink {
    path: String,
    query: String,
}

impl PageLink {
    /// A link to `path` that repeats the filters that are set.
    pub fn new(path: impl Into<String>, limit: u32, filters: &[(&str, Option<String>)]) -> Self {
        let mut query = format!("limit={limit}");
        for (name, value) in filters {
            if let Some(value) = value {
                // Filters are ids and words from closed sets: nothing in them needs escaping.
                query.push_str(&format!("&{name}={value}"));
            }
        }
        Self { path: path.into(), query }
    }

    fn after(&self, id: Uuid) -> String {
        format!("{}?{}&cursor={}", self.path, self.query, cursor_from_id(id))
    }
}

/// The cursor of a page that begins after `id`.
pub fn cursor_from_id(id: Uuid) -> String {
    CURSOR.encode(id.as_bytes())
}

/// The id after which a page begins.
///
/// # Errors
/// [`ApiError::InvalidRequest`] when the text never was a cursor.
pub fn id_from_cursor(cursor: Option<&str>) -> Result<Option<Uuid>, ApiError> {
    let Some(cursor) = cursor else { return Ok(None) };
    let bytes = CURSOR.decode(cursor).ok();
    let id = bytes.and_then(|bytes| Uuid::from_slice(&bytes).ok());
    id.map(Some).ok_or_else(|| ApiError::field("cursor", "is not a cursor; take it from `next` of the page before"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::Page as Stored;

    #[test]
    fn a_cursor_leads_back_to_its_id() {
        let id = Uuid::from_u128(0x0192_7f3a_0000_7000_8000_0000_0000_00ff);
        assert_eq!(id_from_cursor(Some(&cursor_from_id(id))).unwrap(), Some(id));
        assert!(id_from_cursor(Some("not a cursor")).is_err());
    }

    #[test]
    fn the_link_to_the_next_page_repeats_the_filters_that_are_set() {
        let last = Uuid::from_u128(7);
        let link = PageLink::new("/v1/jobs", 2, &[("state", Some("failed".into())), ("session_id", None)]);
        let page =
            Page::from_stored(Stored { items: vec![1, 2], next: Some(last) }, &link, |id| id, |row: i32| row * 10);
        assert_eq!(page.items, [10, 20]);
        assert_eq!(page.next.unwrap(), format!("/v1/jobs?limit=2&state=failed&cursor={}", cursor_from_id(last)));
        let page = Page::from_stored(Stored { items: vec![1], next: None::<Uuid> }, &link, |id| id, |row: i32| row);
        assert_eq!(page.next, None);
    }
}
