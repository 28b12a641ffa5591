#include <cmath>
#include <string>

#include "tests/accuracy/limit.h"
#include "tests/accuracy/limits.h"

namespace fathom::accuracy {

int CheckContactLimits(const nlohmann::json& report) {
  int missed = 0;
  const auto rows = [&report](const char* figure) {
    return report.value(figure, nlohmann::json::array());
  };

  for (const auto& row : rows("contact_reference")) {
    Limit reference(
        "reference " + row["scene"].get<std::string>() + ": worst error",
        row["limit"].get<double>());
    reference.Offer(row["worst_error"], row["source"].get<std::string>());
    missed += reference.Report();
  }

  // chi^2 at 2.5 and 97.5 % of 100 runs; the lower bounds with their sign
  // turned. A fifth below per_axis is asked for where it can be had: where a
  // filter that is told the true direction for its weights is a quarter and
  // more below; elsewhere ours has to be within a tenth of that one.
  Limit nees("contacts: mean NEES, 100 runs", 4.5731);
  Limit least_nees("contacts: mean NEES, least, negative", -3.4648);
  Limit nis("contacts: mean NIS, 100 runs", 2.4106);
  Limit least_nis("contacts: mean NIS, least, negative", -1.6273);
  Limit ratio("contacts: rmse over that of per_axis", 0.99999);
  Limit bearing("contacts: the same where 0.75 and less can be had", 0.8);
  Limit told("contacts: elsewhere, over rmse with true directions", 1.1);
  for (const auto& row : rows("contact_consistency")) {
    const std::string where = Where(row);
    nees.Offer(row["nees"], where);
    least_nees.Offer(-row["nees"].get<double>(), where);
    nis.Offer(row["nis"], where);
    least_nis.Offer(-row["nis"].get<double>(), where);
    ratio.Offer(row["rmse_ratio"], where);
    if (row["told_ratio"] <= 0.75) {
      bearing.Offer(row["rmse_ratio"], where);
    } else {
      told.Offer(row["over_told"], where);
    }
  }
  missed += nees.Report() + least_nees.Report() + nis.Report() +
            least_nis.Report() + ratio.Report() + bearing.Report() +
            told.Report();

  // The same against the posterior's mean, which nobody is below.
  Limit reached("contacts: rmse over per_axis, where 0.8 can be had", 0.8);
  Limit optimal("contacts: elsewhere, over rmse of the posterior's mean", 1.05);
  for (const auto& row : rows("contact_optimum")) {
    if (row["optimal_ratio"] <= 0.8) {
      reached.Offer(row["rmse_ratio"], Where(row));
    } else {
      optimal.Offer(row["over_optimal"], Where(row));
    }
  }
  missed += reached.Report() + optimal.Report();

  Limit held("contacts: points off 50, 90, 99 %, 0 to 10 min ahead", 3);
  for (const auto& row : rows("contact_prediction")) {
    for (const int share : {50, 90, 99}) {
      const double percent =
          row["within_" + std::to_string(share) + "_percent"];
      held.Offer(std::abs(percent - share), "minutes=" + row["minutes"].dump());
    }
  }
  missed += held.Report();

  // Told too wide is no harm; too narrow is.
  Limit bold("contacts: points below 50, 90, 99 %, 1 to 60 min ago", 3);
  Limit wide("contacts: points above 50, 90, 99 %, 1 to 60 min ago", 15);
  Limit past_nees("contacts: mean NEES, 1 to 60 min ago", 4.5731);
  for (const auto& row : rows("contact_past")) {
    const std::string where =
        Where(row) + " minutes_ago=" + row["minutes_ago"].dump();
    past_nees.Offer(row["nees"], where);
    for (const int share : {50, 90, 99}) {
      const double percent =
          row["within_" + std::to_string(share) + "_percent"];
      bold.Offer(share - percent, where);
      wide.Offer(percent - share, where);
    }
  }
  missed += bold.Report() + wide.Report() + past_nees.Report();

  Limit out("thesis run: percent of errors beyond 3 std", 1);
  Limit falls("thesis run: rms error after 15 min over that after 1", 0.9999);
  Limit slower("thesis run: rms error, noise over twice the noise", 0.9999);
  double before = 0;
  for (const auto& row : rows("contact_thesis")) {
    const std::string where = "noise=" + row["noise"].dump();
    out.Offer(100 - row["within_3std_percent"].get<double>(), where);
    for (const char* what : {"range_m_", "position_m_", "velocity_m_s_"}) {
      const std::string key = what;
      falls.Offer(
          row[key + "15_min"].get<double>() / row[key + "1_min"].get<double>(),
          key + where);
    }
    const double now = row["position_m_15_min"];
    if (before > 0) slower.Offer(before / now, where);
    before = now;
  }
  missed += out.Report() + falls.Report() + slower.Report();

  Limit radar("recorded radar, calibrated: median rmse, m (plain 8.0)", 8.0);
  Limit absurd("recorded AIS: absurd outliers taken", 0);
  Limit lost("recorded AIS: vessels not tracked", 0);
  for (const auto& row : rows("contact_recorded")) {
    if (row["scene"] == "radar_four_state_calibrated") {
      radar.Offer(row["median_rmse_m"], Where(row));
    } else if (row["scene"] == "ais_solent") {
      absurd.Offer(1 - row["absurd_gated"].get<double>(), Where(row));
      lost.Offer(row["vessels"].get<double>() - row["tracked"].get<double>(),
                 Where(row));
    }
  }
  missed += radar.Report() + absurd.Report() + lost.Report();
  return missed;
}

}  // namespace fathom::accuracy
