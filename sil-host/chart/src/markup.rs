//! Text inside XML and HTML, and pages of it.

/// Style of a page that is read: light and dark, on a phone too.
const STYLE: &str = "\
body{font-family:Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;color:#1a1a1a;background:#fff;\
margin:0 auto;max-width:1040px;padding:24px;line-height:1.45}\
table{border-collapse:collapse;width:100%;font-size:14px;margin:16px 0}\
th,td{text-align:left;vertical-align:top;\
padding:4px 10px;border-bottom:1px solid #ddd}h2{font-size:19px;margin:32px 0 4px}p{margin:4px 0 8px}\
.passed{color:#0a6b2d}.failed{color:#b00020;font-weight:bold}.noted{color:#666}\
@media(prefers-color-scheme:dark){body{color:#e8e8e8;background:#161616}th,td{border-color:#444}\
.passed{color:#3fc39a}.failed{color:#ff8a80}.noted{color:#a0a0a0}}";

/// Escapes the characters that have a meaning in XML and HTML, inside elements and in quoted
/// attributes.
pub fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// Returns a page without scripts, with its title as a heading above `body`.
pub fn document(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{title}</title>\
         <style>{STYLE}</style><h1>{title}</h1>{body}</html>\n"
    )
}
