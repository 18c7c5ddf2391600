% Scenario 1 of Cario et al., Sensors 2021, 21(3), 762, simulated one run at a time.
%
% Written as one follows the paper: sections 2 and 4 for the platform, its GPS and IMU and the
% ranges, section 3 for the EKF. What the paper does not give is that of the preset "paper-literal".
% NED frame, m, s, rad.
%
% octave-cli octave_study.m [--runs N] [--seed N] [--sampling_time S] [--baseline M] [--gps_std M]
%     [--imu_std_deg DEG] [--depth_std M] [--range_std M] [--loss_probability P]
% prints JSON: one row of RMS errors per run (x, y, z, total) and the time per step.

1;  % a script file, although it begins with functions

function p = target_position(t)
  radius = 15;
  speed = 0.5;
  angle = speed * t / radius;
  p = [radius * cos(angle); radius * sin(angle); 5];
end

function R = rotation(roll, pitch, yaw)
  Rx = [1, 0, 0; 0, cos(roll), -sin(roll); 0, sin(roll), cos(roll)];
  Ry = [cos(pitch), 0, sin(pitch); 0, 1, 0; -sin(pitch), 0, cos(pitch)];
  Rz = [cos(yaw), -sin(yaw), 0; sin(yaw), cos(yaw), 0; 0, 0, 1];
  R = Rz * Ry * Rx;
end

function rms = simulate(f)
  T = f.sampling_time;
  % As in sblcosim, the last two samples of a run come too late for an estimate.
  steps = floor(pi * 15 / 0.5 / T) - 2;
  n = 4;

  % Platform: beacons on a cross, waves (section 4)
  a = f.baseline;
  beacons = [a, 0, -a, 0; 0, a, 0, -a; 0.5, 0.5, 0.5, 0.5];
  amplitude = 5 * pi / 180 * [1; 1; 1];
  frequency = [0.30; 0.25; 0.05];
  phase = 2 * pi * rand(3, 1);
  % A packet is lost if a unit normal is below this threshold (section 4)
  threshold = -sqrt(2) * erfcinv(2 * f.loss_probability);

  % EKF (section 3)
  Phi = kron(eye(3), [1, T; 0, 1]);
  Q = 0.01 * kron(eye(3), [T^3 / 3, T^2 / 2; T^2 / 2, T]);
  R = diag([f.range_std * ones(1, n), f.depth_std]);  % the standard deviations, as printed
  start = target_position(0);
  x = [start(1); 0; start(2); 0; start(3); 0];
  P = eye(6);

  ranges = zeros(n, 1);
  heard = false(n, 1);
  known = zeros(3, n);
  e = zeros(3, steps);
  for k = 1:steps
    t = k * T;
    truth = target_position(t);

    % Pose and what GPS and IMU make of it
    angles = amplitude .* sin(2 * pi * frequency * t + phase);
    s = rotation(angles(1), angles(2), angles(3)) * beacons;
    measured = angles + f.imu_std * randn(3, 1);
    gps_error = [f.gps_std * randn(2, 1); 0];
    reported = gps_error + rotation(measured(1), measured(2), measured(3)) * beacons;

    % Round robin: one beacon at each instant
    i = mod(k - 1, n) + 1;
    if randn() >= threshold
      ranges(i) = norm(truth - s(:, i)) + f.range_std * randn();
      heard(i) = true;
      known = reported;
    end
    depth = truth(3) + f.depth_std * randn();

    % Predictor
    x = Phi * x;
    P = Phi * P * Phi' + Q;

    % Corrector, with the latest range of each beacon
    h = zeros(n + 1, 1);
    H = zeros(n + 1, 6);
    position = x([1, 3, 5]);
    for j = 1:n
      d = position - known(:, j);
      h(j) = norm(d);
      H(j, [1, 3, 5]) = d' / h(j);
    end
    h(n + 1) = x(5);
    H(n + 1, 5) = 1;
    z = [ranges; depth];
    used = [heard; true];
    H = H(used, :);
    K = P * H' / (H * P * H' + R(used, used));
    x = x + K * (z(used) - h(used));
    P = P - K * H * P;

    e(:, k) = truth - x([1, 3, 5]);
  end
  mean_square = mean(e.^2, 2);
  rms = sqrt([mean_square; sum(mean_square)])';
end

f = struct('runs', 10, 'seed', 1, 'sampling_time', 0.1, 'baseline', 3, 'gps_std', 0.1, ...
           'imu_std_deg', 1, 'depth_std', 0.01, 'range_std', 0.1, 'loss_probability', 0);
arguments = argv();
for i = 1:2:numel(arguments)
  f.(arguments{i}(3:end)) = str2double(arguments{i + 1});
end
f.imu_std = f.imu_std_deg * pi / 180;
rand('twister', [f.seed, 1]);
randn('twister', [f.seed, 2]);

rms = zeros(f.runs, 4);
us_per_step = zeros(f.runs, 1);
for run = 1:f.runs
  began = tic();
  rms(run, :) = simulate(f);
  us_per_step(run) = toc(began) / (floor(pi * 15 / 0.5 / f.sampling_time) - 2) * 1e6;
end
disp(jsonencode(struct('rms', rms, 'us_per_step', min(us_per_step), 'version', version())));
