//! Single-file pages that need no network.

use motorium_pictures::escape;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#1f2328}\
table{border-collapse:collapse;margin:1em 0}td,th{padding:.25em .8em;border-bottom:1px solid #d0d7de;text-align:left}\
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}td.n{white-space:nowrap}h2{margin-top:2em}svg{max-width:100%;height:auto}\
.strip{display:flex;gap:6px}.strip span{flex:1;text-align:center;font-size:13px}.strip img{display:block;width:100%;border-radius:4px}\
.error{color:#d1242f}.warning{color:#9a6700}.dim{color:#57606a}.wide{overflow-x:auto}ul.columns{columns:3 20em;font-size:13px}\
@media(prefers-color-scheme:dark){body{background:#0d1117;color:#e6edf3}td,th{border-color:#30363d}\
.error{color:#ff7b72}.warning{color:#e3b341}.dim{color:#9da7b3}}\
@media print{body{max-width:none;margin:0;font-size:12px}h2{break-after:avoid;margin-top:1em}svg,tr{break-inside:avoid}}";

/// Returns a page with a title above its body, in light and in dark colours.
pub(crate) fn page(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><meta name=\"color-scheme\" content=\"light dark\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>{0}</title><style>{STYLE}</style>\
         </head>\n<body>\n<h1>{0}</h1>\n{body}</body>\n</html>\n",
        escape(title)
    )
}

/// Returns a table of names and values.
pub(crate) fn facts<'a>(rows: impl IntoIterator<Item = (&'a str, String)>) -> String {
    let row =
        |(name, value): (&str, String)| format!("<tr><th>{name}</th><td>{}</td></tr>\n", escape(&value));
    let rows: String = rows.into_iter().map(row).collect();
    format!("<table>\n{rows}</table>\n")
}

/// Returns a file as a data URL for the page (RFC 2397, in Base64 of RFC 4648).
pub(crate) fn data_url(media_type: &str, file: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = format!("data:{media_type};base64,");
    for bytes in file.chunks(3) {
        let at = |index: usize| u32::from(bytes.get(index).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        let letter = |index: usize| match index <= bytes.len() {
            true => char::from(LETTERS[(bits >> (18 - 6 * index) & 63) as usize]),
            false => '=',
        };
        text.extend((0..4).map(letter));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::data_url;

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(data_url("text/plain", bytes.as_bytes()), format!("data:text/plain;base64,{text}"));
        }
    }
}
