//! Lists in pages: the cursor is the last id that was seen, so a page costs the same wherever it stands.

use uuid::Uuid;

/// Most items that one page may hold.
pub const MAX_PAGE_ITEMS: u32 = 200;

/// Which part of a list is wanted. Lists run from the newest to the oldest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageRequest<Id> {
    /// The last id of the page before; `None` for the first page.
    pub after: Option<Id>,
    /// Items wanted, clamped to 1 ..= [`MAX_PAGE_ITEMS`].
    pub limit: u32,
}

impl<Id> PageRequest<Id> {
    /// The first `limit` items.
    pub fn first(limit: u32) -> Self {
        Self { after: None, limit }
    }

    pub(crate) fn items(&self) -> usize {
        self.limit.clamp(1, MAX_PAGE_ITEMS) as usize
    }

    /// Every id on the page is smaller. A plain bound, and not "no bound on the first page": an index can seek to it.
    pub(crate) fn cursor(&self) -> Uuid
    where
        Id: Copy + Into<Uuid>,
    {
        self.after.map_or(Uuid::max(), Into::into)
    }

    /// One row more than the page holds tells whether there is a next page.
    pub(crate) fn rows(&self) -> i64 {
        self.items() as i64 + 1
    }
}

/// One page of a list.
#[derive(Debug, Clone, PartialEq)]
pub struct Page<T, Id> {
    /// The items, newest first.
    pub items: Vec<T>,
    /// The cursor of the next page; `None` on the last page.
    pub next: Option<Id>,
}

impl<T, Id> Page<T, Id> {
    pub(crate) fn from_rows(mut items: Vec<T>, request: &PageRequest<Id>, id: impl Fn(&T) -> Id) -> Self {
        let more = items.len() > request.items();
        items.truncate(request.items());
        let next = if more { items.last().map(id) } else { None };
        Self { items, next }
    }
}
