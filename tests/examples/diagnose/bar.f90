! Central differences for a bar, and mistakes that can be planted in it: bar CELLS OUT MISTAKE.
program bar
  use mms_axis_aligned_1d, only: dp, solution, parameters, prepare, u, v, b, lambda, mu, density, period, wave_speed
  implicit none
  type(solution) :: s
  character(:), allocatable :: message
  character(64) :: word, out, mistake
  integer :: n, i, step, steps, unit
  real(dp) :: h, dt, t, at, rho, lam, m, weight, X(1)
  real(dp), allocatable :: w(:), vel(:), F(:), P(:), force(:)

  call get_command_argument(1, word)
  call get_command_argument(2, out)
  call get_command_argument(3, mistake)
  read (word, *) n
  call prepare(s, parameters(), message)
  if (len(message) > 0) error stop 'these parameters cannot be'
  h = 1.0_dp/n
  rho = density(s)
  lam = lambda(s)
  m = mu(s)
  steps = ceiling(0.4_dp*period(s)*wave_speed(s)/(0.3_dp*h))
  dt = 0.4_dp*period(s)/steps
  if (mistake == 'lambda-missing') lam = 0
  if (mistake == 'mu-doubled') m = 2*m
  allocate (w(0:n), vel(0:n), F(n), P(n), force(0:n))
  do i = 0, n
    X = i*h
    w(i:i) = u(s, X, 0.0_dp)
    at = -dt/2
    vel(i:i) = v(s, X, at)
  end do
  if (mistake == 'initial-velocity-halved') vel = vel/2
  do step = 0, steps - 1
    t = step*dt
    F = 1 + (w(1:) - w(:n - 1))/h
    P = m*(F - 1/F) + lam*log(F)/F
    if (mistake == 'stress-kirchhoff') P = P*F
    if (mistake == 'stress-second-piola-kirchhoff') P = P/F
    if (mistake == 'law-small-strain') P = (lam + 2*m)*(F - 1)
    weight = 1/h
    if (mistake == 'internal-force-halved') weight = weight/2
    force = 0
    force(1:n - 1) = (P(2:) - P(:n - 1))*weight/rho
    if (mistake == 'internal-force-without-density') force = force*rho
    do i = 1, n - 1
      X = i*h
      at = t
      if (mistake == 'force-step-ahead') at = t + dt
      if (mistake == 'force-step-behind') at = t - dt
      if (mistake == 'force-at-current-position') X = X + w(i)
      if (mistake == 'force-half-a-cell-off') X = X + h/2
      weight = 1
      if (mistake == 'force-sign') weight = -1
      if (mistake == 'force-per-volume') weight = rho
      if (mistake == 'force-halved') weight = 0.5_dp
      if (mistake == 'force-unused') weight = 0
      force(i:i) = force(i:i) + weight*b(s, X, at)
      if (mistake == 'mass-doubled') force(i) = force(i)/2
    end do
    vel(1:n - 1) = vel(1:n - 1) + dt*force(1:n - 1)
    w(1:n - 1) = w(1:n - 1) + dt*vel(1:n - 1)
  end do
  open (newunit=unit, file=trim(out)//'/bar.csv')
  write (unit, '(a)') 't,X,ux'
  do i = 0, n
    write (unit, '(es24.16, 2(",", es24.16))') steps*dt, i*h, w(i)
  end do
  close (unit)
  open (newunit=unit, file=trim(out)//'/dt')
  write (unit, '(es24.16)') dt
end program
