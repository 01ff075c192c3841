#include "perch/target/sheet.h"

#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr double kRounding = 1e-9;  // mm: sums of a few metres

Bounds bounds(double left, double bottom, double width, double height) {
  return {{left, bottom}, {left + width, bottom + height}};
}

TEST(Sheet, WithoutPaperIsOneInTrueSizeWithRoomForMarksRulersAndCaption) {
  const SheetPlan plan = plan_sheets(bounds(-0.5, -0.5, 1, 1), Paper::kNone);
  EXPECT_FALSE(plan.tiled());
  ASSERT_EQ(plan.sheets.size(), 1u);
  EXPECT_NEAR(plan.sheets[0].window_size.width, 1000 + 2 * kMarkMargin, kRounding);
  EXPECT_NEAR(plan.page.width, 1000 + 4 * kMarkMargin + 2 * kPageMargin + kRulerStrip, kRounding);
  EXPECT_NEAR(plan.page.height, 1000 + 4 * kMarkMargin + 2 * kPageMargin + kFoot, kRounding);
  // The window's upper left corner shows the target's, a mark margin away.
  EXPECT_THAT(plan.sheets[0].drawing, IsNearMatrix(Eigen::Vector2d(-505, 505), kRounding));
}

TEST(Sheet, TheSmallestTargetStillHasItsRulersWhole) {
  const SheetPlan plan = plan_sheets(bounds(0, 0, 0.01, 0.01), Paper::kNone);
  EXPECT_GE(plan.sheets[0].window_size.width, kRuler);
  EXPECT_GE(plan.sheets[0].window_size.height, kRuler);
}

TEST(Sheet, ATargetThatFitsIsOnOnePageInItsMiddle) {
  const SheetPlan plan = plan_sheets(bounds(0, 0, 0.15, 0.1), Paper::kA4);
  ASSERT_EQ(plan.sheets.size(), 1u);
  const Sheet& sheet = plan.sheets[0];
  EXPECT_NEAR(sheet.drawing.x() + sheet.window_size.width / 2, 75, kRounding);
  EXPECT_NEAR(sheet.drawing.y() - sheet.window_size.height / 2, 50, kRounding);
}

TEST(Sheet, ATargetThatFitsAcrossTurnsThePage) {
  const SheetPlan plan = plan_sheets(bounds(0, 0, 0.24, 0.15), Paper::kA4);
  EXPECT_FALSE(plan.tiled());
  EXPECT_EQ(plan.page.width, 297);
}

TEST(Sheet, AMetreTakes24SheetsOfA4And12OfA3) {
  // A4 upright shows 178 x 251+10 mm: 6 x 178 - 5 x 10 and 4 x 261 - 3 x 10 are the least above 1010.
  const SheetPlan a4 = plan_sheets(bounds(-0.5, -0.5, 1, 1), Paper::kA4);
  EXPECT_EQ(a4.columns, 6);
  EXPECT_EQ(a4.rows, 4);
  EXPECT_EQ(tile_name(a4.sheets[7]), "r2c2");
  // A3 upright shows 265 x 384: 4 x 265 - 30 and 3 x 384 - 20.
  EXPECT_EQ(plan_sheets(bounds(-0.5, -0.5, 1, 1), Paper::kA3).sheets.size(), 12u);
}

TEST(Sheet, RandomTargetsAreCoveredByWindowsThatOverlapInsideThePrintableArea) {
  for (unsigned run = 0; run < 300; ++run) {
    TestRng rng(run);
    const Bounds target =
        bounds(rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(0.01, 3), rng.uniform(0.01, 3));
    for (const Paper paper : {Paper::kNone, Paper::kA4, Paper::kA3, Paper::kLetter}) {
      const SheetPlan plan = plan_sheets(target, paper);
      ASSERT_EQ(plan.sheets.size(), static_cast<size_t>(plan.rows * plan.columns));
      for (const Sheet& sheet : plan.sheets) {
        // A mark margin around the window, and all of it off the edge that printers leave white.
        EXPECT_GE(sheet.window.x() - kMarkMargin - kRulerStrip, kPageMargin - kRounding);
        EXPECT_GE(sheet.window.y() - kMarkMargin, kPageMargin - kRounding);
        EXPECT_LE(sheet.window.x() + sheet.window_size.width + kMarkMargin,
                  plan.page.width - kPageMargin + kRounding);
        EXPECT_LE(sheet.window.y() + sheet.window_size.height + kMarkMargin + kFoot,
                  plan.page.height - kPageMargin + kRounding);
        const Sheet& first = plan.sheets[0];
        EXPECT_NEAR(sheet.drawing.x() - first.drawing.x(),
                    sheet.column * (sheet.window_size.width - kOverlap), 1e-6);
        EXPECT_NEAR(first.drawing.y() - sheet.drawing.y(), sheet.row * (sheet.window_size.height - kOverlap),
                    1e-6);
      }
      // With the steps above, the first and the last window tell that all between is covered.
      const Sheet &first = plan.sheets.front(), &last = plan.sheets.back();
      EXPECT_LE(first.drawing.x(), 1000 * target.lower_left.x() - kMarkMargin + 1e-3);
      EXPECT_GE(first.drawing.y(), 1000 * target.upper_right.y() + kMarkMargin - 1e-3);
      EXPECT_GE(last.drawing.x() + last.window_size.width,
                1000 * target.upper_right.x() + kMarkMargin - 1e-3);
      EXPECT_LE(last.drawing.y() - last.window_size.height,
                1000 * target.lower_left.y() - kMarkMargin + 1e-3);
    }
  }
}

}  // namespace
}  // namespace perch
