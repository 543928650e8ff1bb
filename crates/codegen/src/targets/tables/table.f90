
  ! The polynomials at a place between -1 and 1.
  pure function table_polynomials(x, n) result(values)
    real(dp), intent(in) :: x
    integer, intent(in) :: n
    real(dp) :: values(n), last, next, after
    integer :: k
    last = 1.0_dp
    next = x
    do k = 1, n
      values(k) = last
      after = 2.0_dp * x * next - last
      last = next
      next = after
    end do
  end function

  ! The piece of a time among knots, counted from zero, and the polynomials there: not numbers before the start and after the end.
  pure subroutine table_moment(knots, in_time, t, piece, values)
    real(dp), intent(in) :: knots(0:), t
    integer, intent(in) :: in_time
    integer, intent(out) :: piece
    real(dp), intent(out) :: values(in_time)
    real(dp) :: last
    piece = 0
    last = knots(ubound(knots, 1))
    do while (piece + 1 < ubound(knots, 1))
      if (knots(piece + 1) > t) exit
      piece = piece + 1
    end do
    if (t >= -1.0e-12_dp * last .and. t <= last * (1.0_dp + 1.0e-12_dp)) then
      values = table_polynomials((2.0_dp * t - knots(piece) - knots(piece + 1)) / (knots(piece + 1) - knots(piece)), in_time)
    else
      values = not_a_number
    end if
  end subroutine

  ! The products of the polynomials of all axes at a position, a value for each node; not numbers far from the body.
  pure function table_along(tab, X) result(values)
    type(table), intent(in) :: tab
    real(dp), intent(in) :: X(DIMENSION)
    real(dp), allocatable :: values(:), own(:)
    real(dp) :: q(3), place, from_axis, angle, around
    integer :: k, i, before
    q = 0.0_dp
    around = 8.0_dp * atan(1.0_dp)
    q(1:DIMENSION) = X
    if (tab%chart == "t") then
      q(1) = norm2(X(1:min(2, DIMENSION)))
      q(min(2, DIMENSION)) = atan2(X(min(2, DIMENSION)), X(1))
    end if
    if (tab%chart == "a" .and. DIMENSION > 1) then
      from_axis = norm2(X(1:min(2, DIMENSION)))
      angle = atan2(X(min(2, DIMENSION)), X(1))
      if (angle < 0.0_dp) angle = angle + around
      q(1) = norm2(X)
      q(2) = atan2(from_axis, X(DIMENSION))
      q(DIMENSION) = angle
    end if
    allocate (values(product(tab%count)))
    values(1) = 1.0_dp
    before = 1
    do k = 1, tab%axes
      if (tab%chart == "t" .and. tab%axis(k) == 2) then
        q(2) = q(2) + around * anint((0.5_dp * (tab%low(k) + tab%high(k)) - q(2)) / around)
      end if
      place = (2.0_dp * q(tab%axis(k)) - tab%low(k) - tab%high(k)) / (tab%high(k) - tab%low(k))
      if (abs(place) > 1.1_dp) place = not_a_number
      own = table_polynomials(place, tab%count(k))
      do i = tab%count(k), 1, -1
        values((i - 1) * before + 1:i * before) = own(i) * values(1:before)
      end do
      before = before * tab%count(k)
    end do
  end function

  ! Turns the entries of a field to Cartesian components.
  pure subroutine table_turn(tab, X, field, values)
    type(table), intent(in) :: tab
    real(dp), intent(in) :: X(DIMENSION)
    integer, intent(in) :: field
    real(dp), intent(inout) :: values(:)
    integer, parameter :: full(3, 3) = reshape([1, 4, 5, 4, 2, 6, 5, 6, 3], [3, 3])
    real(dp) :: Q(3, 3), own(3, 3), far, off, cosine, sine
    integer :: i, k, d
    if (tab%frame == "c" .or. tab%shape(field) == "s") return
    d = DIMENSION
    off = norm2(X(1:min(2, DIMENSION)))
    far = norm2(X)
    cosine = X(1) / off
    sine = X(min(2, DIMENSION)) / off
    Q = 0.0_dp
    if (tab%frame == "p") then
      Q(1, 1:2) = [cosine, -sine]
      Q(2, 1:2) = [sine, cosine]
      Q(3, 3) = 1.0_dp
    else
      Q(1, :) = [X(1) / far, X(DIMENSION) / far * cosine, -sine]
      Q(2, :) = [X(min(2, DIMENSION)) / far, X(DIMENSION) / far * sine, cosine]
      Q(3, :) = [X(DIMENSION) / far, -off / far, 0.0_dp]
    end if
    own = 0.0_dp
    select case (tab%shape(field))
    case ("v")
      values = matmul(Q(1:d, 1:d), values)
    case ("m")
      own(1:d, 1:d) = transpose(reshape(values, [d, d]))
      own(1:d, 1:d) = matmul(matmul(Q(1:d, 1:d), own(1:d, 1:d)), transpose(Q(1:d, 1:d)))
      values = reshape(transpose(own(1:d, 1:d)), [d * d])
    case default
      do i = 1, 3
        do k = 1, 3
          own(i, k) = values(full(i, k))
        end do
      end do
      own = matmul(matmul(Q, own), transpose(Q))
      values = [own(1, 1), own(2, 2), own(3, 3), own(1, 2), own(1, 3), own(2, 3)]
    end select
  end subroutine

  ! The number of a point of the table, by its position; 0 where there is no such point.
  pure integer function table_point_of(tab, X) result(number)
    type(table), intent(in) :: tab
    real(dp), intent(in) :: X(DIMENSION)
    real(dp) :: least
    number = 0
    if (tab%points == 0) return
    least = 1.0e-12_dp * maxval(abs(tab%places(:, :tab%points)))
    do number = 1, tab%points
      if (all(abs(X - tab%places(:, number)) <= 1.0e-9_dp * abs(tab%places(:, number)) + least)) return
    end do
    number = 0
  end function

  ! The fields from number `first` to number `last` at a position and a time, in Cartesian components, one after the other.
  pure function table_fields(tab, X, t, first, last, count) result(values)
    type(table), intent(in) :: tab
    real(dp), intent(in) :: X(DIMENSION), t
    integer, intent(in) :: first, last, count
    real(dp) :: values(count), of_time(most_polynomials)
    real(dp), allocatable :: along(:)
    integer :: piece, entry, column, number, field, k
    values = not_a_number
    if (tab%points > 0) then
      number = table_point_of(tab, X)
      if (number > 0) values = table_entries(tab%of_points(number), t, tab%first(first), count)
      return
    end if
    if (.not. allocated(tab%coefficients)) return
    call table_moment(tab%knots, tab%in_time, t, piece, of_time(1:tab%in_time))
    along = table_along(tab, X)
    do entry = 1, count
      column = ((tab%first(first) + entry - 1) * (size(tab%knots) - 1) + piece) * tab%in_time
      values(entry) = 0.0_dp
      do k = 1, tab%in_time
        values(entry) = values(entry) + of_time(k) * dot_product(along, tab%coefficients(:, column + k))
      end do
    end do
    do field = first, last
      call table_turn(tab, X, field, values(tab%first(field) - tab%first(first) + 1:tab%first(field + 1) - tab%first(first)))
    end do
  end function

  ! Entries of a series at a time, those after the number `first`.
  pure function table_entries(own, t, first, count) result(values)
    type(series), intent(in) :: own
    real(dp), intent(in) :: t
    integer, intent(in) :: first, count
    real(dp) :: values(count), of_time(most_polynomials)
    integer :: piece, entry, n
    values = not_a_number
    if (.not. allocated(own%knots)) return
    n = size(own%coefficients, 1)
    call table_moment(own%knots, n, t, piece, of_time(1:n))
    do entry = 1, count
      values(entry) = dot_product(own%coefficients(:, piece + 1, first + entry), of_time(1:n))
    end do
  end function

  ! The fields at a position as series in time, from which b_of_series and its like have them at any time by short sums.
  pure function series_of(s, X) result(own)
    type(solution), intent(in) :: s
    real(dp), intent(in) :: X(DIMENSION)
    type(series) :: own
    real(dp), allocatable :: along(:)
    integer :: piece, k, field, entry, pieces, number
    associate (tab => s%fields_of_histories)
      if (tab%points > 0) then
        number = table_point_of(tab, X)
        if (number > 0) own = tab%of_points(number)
        return
      end if
      if (.not. allocated(tab%coefficients)) return
      pieces = size(tab%knots) - 1
      allocate (own%knots, source=tab%knots)
      allocate (own%coefficients(tab%in_time, pieces, tab%first(ubound(tab%first, 1))))
      along = table_along(tab, X)
      do entry = 1, size(own%coefficients, 3)
        do piece = 1, pieces
          do k = 1, tab%in_time
            own%coefficients(k, piece, entry) = dot_product(along, &
              tab%coefficients(:, ((entry - 1) * pieces + piece - 1) * tab%in_time + k))
          end do
        end do
      end do
      do field = 0, ubound(tab%shape, 1)
        do piece = 1, pieces
          do k = 1, tab%in_time
            call table_turn(tab, X, field, own%coefficients(k, piece, tab%first(field) + 1:tab%first(field + 1)))
          end do
        end do
      end do
    end associate
  end function

  ! Reads the table of the fields that follow from histories, after prepare; the message is empty where it is that of this source.
  subroutine read_table(s, path, message)
    type(solution), intent(inout) :: s
    character(*), intent(in) :: path
    character(:), allocatable, intent(out) :: message
    integer :: file, failure, version
    character(72) :: word, found
    type(table) :: tab
    message = ""
    s%fields_of_histories = tab
    open (newunit=file, file=path, status="old", action="read", iostat=failure)
    if (failure /= 0) then
      message = MISSING
      return
    end if
    version = 0
    found = ""
    read (file, *, iostat=failure) word, version
    if (failure == 0) read (file, *, iostat=failure) word, found
    if (failure == 0 .and. version == 1 .and. found /= "DIGEST") then
      message = ANOTHER
    else
      if (failure == 0) call table_content(file, tab, failure)
      if (failure /= 0 .or. version /= 1) message = BROKEN
    end if
    close (file)
    if (len(message) == 0) s%fields_of_histories = tab
  end subroutine

  subroutine table_content(file, tab, failure)
    integer, intent(in) :: file
    type(table), intent(inout) :: tab
    integer, intent(out) :: failure
    character(72) :: word, kind
    integer :: count, k, d, size_of
    read (file, *, iostat=failure) word, kind
    if (failure == 0) read (file, *, iostat=failure) word, count
    do k = 1, merge(count, 0, failure == 0)
      read (file, *, iostat=failure) word
    end do
    if (failure == 0) read (file, *, iostat=failure) word, tab%end
    if (failure == 0) read (file, *, iostat=failure) word
    if (failure == 0) read (file, *, iostat=failure) word, d
    if (failure == 0) read (file, *, iostat=failure) word, count
    if (failure /= 0) return
    allocate (tab%shape(0:count - 1), tab%first(0:count))
    tab%first(0) = 0
    do k = 0, count - 1
      read (file, *, iostat=failure) word, kind
      if (failure /= 0) return
      size_of = 1
      if (kind == "vector") size_of = d
      if (kind == "matrix") size_of = d * d
      if (kind == "symmetric") size_of = 6
      tab%shape(k) = kind(1:1)
      if (kind == "symmetric") tab%shape(k) = "t"
      tab%first(k + 1) = tab%first(k) + size_of
    end do
    read (file, *, iostat=failure) word, kind
    if (failure /= 0) return
    tab%chart = kind(1:1)
    read (file, *, iostat=failure) word, tab%frame
    if (failure /= 0) return
    if (kind == "points") then
      call table_points(file, tab, failure)
      return
    end if
    read (file, *, iostat=failure) word, tab%axes
    if (failure /= 0) return
    do k = 1, min(tab%axes, 3)
      read (file, *, iostat=failure) tab%axis(k), tab%low(k), tab%high(k), tab%count(k)
      if (failure /= 0) return
      tab%axis(k) = tab%axis(k) + 1
    end do
    read (file, *, iostat=failure) word, count, tab%in_time
    if (failure /= 0) return
    if (tab%in_time > most_polynomials .or. count < 1) failure = 1
    if (failure /= 0) return
    allocate (tab%knots(0:count))
    read (file, *, iostat=failure) tab%knots
    if (failure == 0) read (file, *, iostat=failure) word
    if (failure /= 0) return
    allocate (tab%coefficients(product(tab%count), tab%in_time * count * tab%first(ubound(tab%first, 1))))
    read (file, *, iostat=failure) tab%coefficients
  end subroutine

  subroutine table_points(file, tab, failure)
    integer, intent(in) :: file
    type(table), intent(inout) :: tab
    integer, intent(out) :: failure
    character(72) :: word
    integer :: k, count, pieces, in_time
    read (file, *, iostat=failure) word, count
    if (failure /= 0) return
    allocate (tab%places(DIMENSION, count), tab%of_points(count))
    do k = 1, count
      read (file, *, iostat=failure) tab%places(:, k), pieces, in_time
      if (failure /= 0) return
      if (in_time > most_polynomials .or. pieces < 1) failure = 1
      if (failure /= 0) return
      allocate (tab%of_points(k)%knots(0:pieces))
      allocate (tab%of_points(k)%coefficients(in_time, pieces, tab%first(ubound(tab%first, 1))))
      read (file, *, iostat=failure) tab%of_points(k)%knots
      if (failure == 0) read (file, *, iostat=failure) tab%of_points(k)%coefficients
      if (failure /= 0) return
    end do
    tab%points = count
  end subroutine
