//! What axe-core finds on a page. It is kept in `axe/` as its makers publish it, under the Mozilla Public License 2.0.

use crate::browser::driver::Browser;

const AXE: &str = include_str!("axe/axe.min.js");

/// The findings that keep somebody from using the page: rule, and the first elements that break it.
pub async fn serious_findings(page: &Browser) -> Vec<String> {
    page.run(AXE).await;
    let report = page
        .evaluate_later(
            "axe.run(document, { resultTypes: ['violations'] }).then(({ violations }) => violations
                .filter(({ impact }) => impact === 'serious' || impact === 'critical')
                .map(({ id, nodes }) => `${id}: ${nodes.slice(0, 3).map(({ html }) => html).join(' ')}`))",
        )
        .await;
    let findings = report.as_array().unwrap_or_else(|| panic!("axe-core ran: {report}"));
    findings.iter().map(|finding| finding.as_str().expect("text").to_owned()).collect()
}
