! As fields.cc, with the module MODULE in its place.
program fields
  use, intrinsic :: iso_fortran_env, only: input_unit
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use MODULE
  implicit none
  integer, parameter :: d = dimension_of_space
  type(solution) :: s
  type(parameters) :: par
  character(:), allocatable :: message
  real(dp) :: count, point(d + 1), X(d), t
  integer :: k, input, output
  !TABLE type(series) :: own
  !TABLE real(dp), parameter :: largest = 1e4_dp
  call prepare(s, par, message)
  if (len(message) > 0) error stop 1
  !TABLE call read_table(s, "TABLE_FILE", message)
  !TABLE if (len(message) > 0) error stop 2
  open (newunit=input, file="points.bin", access="stream", form="unformatted", action="read")
  open (newunit=output, file="values.bin", access="stream", form="unformatted", action="write", status="replace")
  read (input) count
  do k = 1, nint(count)
    read (input) point
    X = point(1:d)
    t = point(d + 1)
    write (output) u(s, X, t), v(s, X, t), a(s, X, t), transpose(H(s, X, t)), transpose(F(s, X, t)), J(s, X, t), &
      transpose(P(s, X, t)), b(s, X, t), rho0_b(s, X, t), static_force(s, X, t), transpose(sigma(s, X, t)), &
      transpose(pk2(s, X, t))
    !TABLE write (output) internal(s, X, t)
    !TABLE own = series_of(s, X)
    !TABLE if (any(abs(b_of_series(own, t) - b(s, X, t)) > 1e-12_dp * largest)) error stop 3
    !TABLE if (any(abs(internal_of_series(own, t) - internal(s, X, t)) > 1e-12_dp * maxval(abs(internal(s, X, t))))) error stop 4
    !TABLE if (any(abs(P_of_series(own, t) - P(s, X, t)) > 1e-12_dp * largest)) error stop 5
  end do
  !TABLE if (.not. all(ieee_is_nan(b(s, X, 1000 * t + 1000)))) error stop 6
  !TABLE call read_table(s, "driver.f90", message)
  !TABLE if (len(message) == 0) error stop 7
end program
