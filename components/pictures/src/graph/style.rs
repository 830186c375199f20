//! Colours of the picture: neutral, and readable on light and dark pages alike.

/// The style sheet. Colours follow the viewer's preference, with a light page as the default.
pub(super) const STYLE: &str = "
text { font-family: ui-sans-serif, system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif; fill: #1f2733; }
.page { fill: #ffffff; stroke: #d5dae1; }
.card { fill: #f5f7f9; stroke: #8a94a3; stroke-width: 1.2; }
.realtime { fill: #3b5b8c; }
.shared { fill: #9aa3ae; }
.title { font-size: 18px; font-weight: 600; }
.name { font-size: 15px; font-weight: 600; }
.kind { font-size: 12px; fill: #3b5b8c; }
.fact { font-size: 12px; fill: #56616f; }
.topic { font-size: 12.5px; font-weight: 500; }
.small { font-size: 11px; fill: #56616f; }
.budget { font-size: 11px; fill: #b93a06; }
.measured { font-size: 11px; fill: #0b6b63; }
.rate { font-size: 12px; fill: #0b6b63; }
.wire { fill: none; stroke: #707b89; stroke-width: 1.5; }
.wakes { stroke-width: 2; }
.reads { stroke-dasharray: 5 4; }
.budgeted { stroke: #c2410c; }
.arrow { fill: #707b89; }
.arrow.budgeted { fill: #c2410c; stroke: none; }
@media (prefers-color-scheme: dark) {
  text { fill: #e6eaef; }
  .page { fill: #14181d; stroke: #2b323b; }
  .card { fill: #1d232a; stroke: #5f6a78; }
  .realtime { fill: #7fa3d9; }
  .shared { fill: #5f6a78; }
  .kind { fill: #8fb2e5; }
  .fact, .small { fill: #9ea9b5; }
  .budget { fill: #fb923c; }
  .measured, .rate { fill: #3fd0be; }
  .wire { stroke: #8c97a4; }
  .arrow { fill: #8c97a4; }
  .budgeted { stroke: #fb923c; }
  .arrow.budgeted { fill: #fb923c; }
}
";
