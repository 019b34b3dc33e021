//! The script and the style sheet, from this binary. Their addresses hold a digest of their bytes, so browsers may keep them for
//! ever; `web/build.mjs` makes them from `web/src`.

use super::error::PageError;
use axum::extract::Path;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use rust_embed::RustEmbed;
use sha2::{Digest, Sha256};
use std::sync::LazyLock;

/// Bytes of the digest that the address shows.
const DIGEST_BYTES: usize = 8;

#[derive(RustEmbed)]
#[folder = "web/dist/"]
struct Files;

/// The files of this build.
pub(super) static BUNDLE: LazyLock<Bundle> =
    LazyLock::new(|| Bundle { script: Asset::of("app", "js"), style: Asset::of("app", "css") });

/// The files that pages refer to.
#[derive(Debug)]
pub(super) struct Bundle {
    /// The script.
    pub script: Asset,
    /// The style sheet.
    pub style: Asset,
}

/// One file.
#[derive(Debug)]
pub(super) struct Asset {
    name: String,
    media_type: String,
    bytes: Bytes,
    /// Where it is served.
    pub address: String,
}

impl Asset {
    fn of(stem: &str, extension: &str) -> Self {
        let file = Files::get(&format!("{stem}.{extension}"));
        let media_type = file.as_ref().map_or_else(String::new, |file| file.metadata.mimetype().to_owned());
        let bytes = file.map_or_else(Bytes::new, |file| Bytes::from(file.data.into_owned()));
        let digest = hex::encode(&Sha256::digest(&bytes)[..DIGEST_BYTES]);
        let name = format!("{stem}-{digest}.{extension}");
        Self { address: format!("/app/assets/{name}"), name, media_type, bytes }
    }
}

/// One file by its name with the digest. A page of an older build asks for older names, which are not here any more.
pub(super) async fn serve(Path(name): Path<String>) -> Result<Response, PageError> {
    let known = [&BUNDLE.script, &BUNDLE.style];
    let asset = known.into_iter().find(|asset| asset.name == name).ok_or(PageError::NotFound("file"))?;
    let headers = [
        (header::CONTENT_TYPE, format!("{}; charset=utf-8", asset.media_type)),
        (header::CACHE_CONTROL, "public, max-age=31536000, immutable".to_owned()),
    ];
    Ok((headers, asset.bytes.clone()).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn script_and_style_are_in_the_binary_and_small_enough() {
        for asset in [&BUNDLE.script, &BUNDLE.style] {
            assert!(asset.bytes.len() > 1000, "{} is missing: run node web/build.mjs", asset.name);
        }
        assert_eq!(
            (BUNDLE.script.media_type.as_str(), BUNDLE.style.media_type.as_str()),
            ("text/javascript", "text/css")
        );
        let mut small = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        for asset in [&BUNDLE.script, &BUNDLE.style] {
            std::io::Write::write_all(&mut small, &asset.bytes).unwrap();
        }
        let bytes = small.finish().unwrap().len();
        assert!(bytes <= 250_000, "{bytes} bytes gzipped");
    }
}
