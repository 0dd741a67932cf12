//! A self-contained HTML page: inline figures, no scripts, no network.

use comfy_table::Table;
use core::fmt::Write;
use painleve_chart::markup;
use serde::Serialize;

/// The page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Title of the page.
    pub title: String,
    /// Introduction, one paragraph.
    pub introduction: String,
    /// Whether the numbers are those of coarse grids and short runs, which the page then says.
    pub is_draft: bool,
    /// Sections from top to bottom.
    pub sections: Vec<Section>,
}

/// One study on the page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Name of its files without extension, and its anchor.
    pub name: String,
    /// Heading, with the paper's number of the figure or table.
    pub title: String,
    /// Commands that reproduce its rows, in order.
    pub commands: Vec<String>,
    /// Statements of the paper with the computed results.
    pub comparisons: Vec<Comparison>,
    /// Reasons for the differences, one paragraph each.
    pub reasons: Vec<String>,
    /// The figure as SVG text.
    pub svg: String,
    /// Table of the numbers.
    pub table: Option<Table>,
    /// Files with the same content, next to the page.
    pub files: Vec<String>,
}

/// A number or statement of the paper, compared with the computed one.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Subject of the comparison.
    pub what: String,
    /// Value or statement of the paper.
    pub paper: String,
    /// Computed result.
    pub here: String,
    /// Verdict of the comparison.
    pub verdict: Verdict,
}

/// Verdict of a comparison with the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Equal to the digits of the paper.
    Agrees,
    /// Different.
    Differs,
    /// Better than in the paper.
    Farther,
    /// Worse than in the paper.
    FallsShort,
    /// The paper gives no value to compare with.
    Open,
}

impl Verdict {
    /// Returns the CSS class and the words on the page.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Agrees => ("yes", "agrees"),
            Self::Farther => ("yes", "goes farther"),
            Self::Differs => ("no", "differs"),
            Self::FallsShort => ("no", "falls short"),
            Self::Open => ("none", ""),
        }
    }
}

impl Comparison {
    /// Creates a comparison that agrees or differs.
    pub fn new(
        what: &str,
        paper: impl Into<String>,
        here: impl Into<String>,
        agrees: bool,
    ) -> Self {
        Self {
            what: what.into(),
            paper: paper.into(),
            here: here.into(),
            verdict: if agrees {
                Verdict::Agrees
            } else {
                Verdict::Differs
            },
        }
    }

    /// Creates a result that the paper does not give.
    pub fn beyond(what: &str, here: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            paper: "–".into(),
            here: here.into(),
            verdict: Verdict::Open,
        }
    }
}

const STYLE: &str = "\
body{font-family:Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;color:#1a1a1a;\
background:#fff;margin:0 auto;max-width:1040px;padding:24px;line-height:1.45}\
h1{font-size:28px;margin:0 0 8px}h2{font-size:21px;margin:48px 0 8px;padding-top:16px;\
border-top:1px solid #ddd}p{max-width:820px}code{background:#f3f3f3;padding:1px 5px;border-radius:3px;\
font-size:90%}table{border-collapse:collapse;margin:12px 0;font-size:14px}th,td{text-align:left;\
vertical-align:top;padding:5px 12px 5px 0;border-bottom:1px solid #e4e4e4}th{border-bottom:2px solid #707070}\
.scroll{overflow-x:auto}.yes{color:#00674c;font-weight:bold}.no{color:#b04a00;font-weight:bold}\
.none{color:#707070}svg{max-width:100%;height:auto}nav h2{border:0;margin:16px 0 0;padding:0}\
.draft{border:2px solid #b04a00;padding:8px 12px;font-weight:bold}\
.files{color:#707070;font-size:14px}a{color:#0072b2}\
@media(max-width:500px){figure{margin:16px -24px!important}}\
@media(prefers-color-scheme:dark){body{color:#e8e8e8;background:#161616}code{background:#2a2a2a}\
th,td{border-color:#444}h2{border-color:#444}.yes{color:#3fc39a}.no{color:#ff9b5e}a{color:#62b5f0}\
.none,.files{color:#a0a0a0}}";

impl Page {
    /// Returns the page as HTML text.
    pub fn html(&self) -> String {
        let mut html = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut html);
        html
    }

    fn write(&self, html: &mut String) -> core::fmt::Result {
        let title = escaped(&self.title);
        writeln!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<p>{}</p>",
            escaped(&self.introduction)
        )?;
        if self.is_draft {
            writeln!(
                html,
                "<p class=\"draft\">Draft: coarse grids and short runs. Its numbers are not results.</p>"
            )?;
        }
        writeln!(
            html,
            "<nav aria-label=\"Contents\">\n<h2>Contents</h2>\n<ol>"
        )?;
        for section in &self.sections {
            let (name, title) = (escaped(&section.name), escaped(&section.title));
            writeln!(html, "<li><a href=\"#{name}\">{title}</a></li>")?;
        }
        writeln!(html, "</ol>\n</nav>")?;
        for section in &self.sections {
            section.write(html)?;
        }
        writeln!(html, "</body>\n</html>")
    }
}

impl Section {
    fn write(&self, html: &mut String) -> core::fmt::Result {
        writeln!(
            html,
            "<section>\n<h2 id=\"{}\">{}</h2>",
            escaped(&self.name),
            escaped(&self.title)
        )?;
        for command in &self.commands {
            writeln!(html, "<p><code>{}</code></p>", escaped(command))?;
        }
        if !self.comparisons.is_empty() {
            writeln!(
                html,
                "<div class=\"scroll\"><table>\n<tr><th></th><th>the paper</th><th>here</th><th></th></tr>"
            )?;
            for comparison in &self.comparisons {
                let (class, verdict) = comparison.verdict.words();
                writeln!(
                    html,
                    "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"{class}\">{verdict}</td></tr>",
                    escaped(&comparison.what),
                    escaped(&comparison.paper),
                    escaped(&comparison.here)
                )?;
            }
            writeln!(html, "</table></div>")?;
        }
        for reason in &self.reasons {
            writeln!(html, "<p>{}</p>", escaped(reason))?;
        }
        writeln!(
            html,
            "<figure style=\"margin:16px 0\">\n{}</figure>",
            self.svg
        )?;
        if let Some(table) = &self.table {
            write_table(html, table)?;
        }
        if !self.files.is_empty() {
            let links: Vec<String> = self
                .files
                .iter()
                .map(|file| format!("<a href=\"{0}\">{0}</a>", escaped(file)))
                .collect();
            writeln!(html, "<p class=\"files\">{}</p>", links.join(" · "))?;
        }
        writeln!(html, "</section>")
    }
}

fn write_table(html: &mut String, table: &Table) -> core::fmt::Result {
    writeln!(html, "<div class=\"scroll\"><table>")?;
    let mut row = |row: &comfy_table::Row, cell: &str| {
        write!(html, "<tr>")?;
        for content in row.cell_iter() {
            write!(html, "<{cell}>{}</{cell}>", escaped(&content.content()))?;
        }
        writeln!(html, "</tr>")
    };
    if let Some(header) = table.header() {
        row(header, "th")?;
    }
    for line in table.row_iter() {
        row(line, "td")?;
    }
    writeln!(html, "</table></div>")
}

/// Escapes text for HTML; removes control characters, which HTML does not allow.
fn escaped(text: &str) -> String {
    let is_kept = |character: &char| !character.is_control() || *character == '\n';
    markup::escaped(&text.chars().filter(is_kept).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_contains_its_figures_and_escapes_its_text() {
        let mut table = Table::new();
        table.set_header(["a < b"]).add_row(["1 & 2"]);
        let page = Page {
            title: "Figures & <tables>".into(),
            introduction: "all \u{7}of them".into(),
            is_draft: true,
            sections: vec![Section {
                name: "one".into(),
                title: "One".into(),
                commands: vec!["painleve study one --set a=\"b\"".into()],
                comparisons: vec![
                    Comparison::new("edge", "0.183", "0.1827", true),
                    Comparison::new("other", "p > 0", "p < 0", false),
                    Comparison::beyond("more", "yes"),
                ],
                reasons: vec!["because".into()],
                svg: "<svg></svg>".into(),
                table: Some(table),
                files: vec!["one.csv".into()],
            }],
        };
        let html = page.html();
        for part in [
            "<h1>Figures &amp; &lt;tables&gt;</h1>",
            "<p>all of them</p>",
            "<li><a href=\"#one\">One</a></li>",
            "Draft: coarse grids",
            "--set a=&quot;b&quot;",
            "<td>p &gt; 0</td><td>p &lt; 0</td><td class=\"no\">differs</td>",
            "<td class=\"yes\">agrees</td>",
            "<svg></svg>",
            "<th>a &lt; b</th>",
            "<td>1 &amp; 2</td>",
            "<a href=\"one.csv\">one.csv</a>",
        ] {
            assert!(html.contains(part), "{part} is not in\n{html}");
        }
        assert!(!html.contains("http") && !html.contains("<script"));
    }
}
