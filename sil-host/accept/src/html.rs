//! The report as a page: no scripts, no network.

use core::fmt::Write;

use painleve_chart::markup::escaped;

use crate::report::{Acceptance, Verdict};

const STYLE: &str = "\
body{font-family:Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;color:#1a1a1a;background:#fff;\
margin:0 auto;max-width:1040px;padding:24px;line-height:1.45}\
table{border-collapse:collapse;width:100%;font-size:14px}th,td{text-align:left;vertical-align:top;\
padding:4px 10px;border-bottom:1px solid #ddd}h2{font-size:19px;margin:32px 0 4px}p{margin:4px 0 8px}\
.passed{color:#0a6b2d}.failed{color:#b00020;font-weight:bold}.noted{color:#666}\
@media(prefers-color-scheme:dark){body{color:#e8e8e8;background:#161616}th,td{border-color:#444}\
.passed{color:#3fc39a}.failed{color:#ff8a80}.noted{color:#a0a0a0}}";

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Noted => "noted",
        Verdict::Failed => "failed",
    }
}

impl Acceptance {
    /// Returns the report as an HTML page.
    pub fn html(&self) -> String {
        let mut page = String::new();
        let chip = escaped(self.chip.unwrap_or("an unknown chip"));
        // Writing to a string does not fail.
        let _ = write!(
            page,
            "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>Acceptance: {chip}</title>\
             <style>{STYLE}</style><h1>Acceptance: {chip}</h1>\
             <p class=\"{}\">{}</p><p>painleve {}, sources {}</p>",
            class(self.verdict),
            self.verdict.word(),
            self.version,
            self.sources,
        );
        for step in &self.steps {
            let _ = write!(
                page,
                "<h2>{} <span class=\"{}\">{}</span></h2><p>{} ({:.1} s)</p>\
                 <table><tr><th>what<th>measured<th>expected<th>verdict</tr>",
                escaped(step.name),
                class(step.verdict),
                step.verdict.word(),
                escaped(step.question),
                step.duration_s,
            );
            for check in &step.checks {
                let _ = write!(
                    page,
                    "<tr><td>{}<td>{}<td>{}<td class=\"{}\">{}</tr>",
                    escaped(&check.what),
                    escaped(&check.measured),
                    escaped(&check.expected),
                    class(check.verdict),
                    check.verdict.word(),
                );
            }
            page.push_str("</table>");
        }
        page.push_str("</html>\n");
        page
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Check, StepReport};

    #[test]
    fn every_check_is_on_the_page_and_its_text_is_escaped() {
        let checks = vec![
            Check::new("clock", "167.9 MHz", "168 MHz ± 0.2 %", true),
            Check::new("level of PB4 <low>", "1", "0", false),
            Check::note("revision", "0x1001"),
        ];
        let step = StepReport {
            name: "clock",
            question: "Which?",
            verdict: Verdict::of(&checks),
            duration_s: 1.0,
            checks,
        };
        let acceptance = Acceptance::new(None, vec![step]);
        assert_eq!(acceptance.failed(), ["clock"]);
        let page = acceptance.html();
        for part in [
            "167.9 MHz",
            "PB4 &lt;low&gt;",
            "0x1001",
            "noted",
            "FAILED",
            "an unknown chip",
        ] {
            assert!(page.contains(part), "{part}: {page}");
        }
    }
}
